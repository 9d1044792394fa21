"""Readers of measurement files, and the conversion of their vectors to a flow.

One module per family of instruments reads `VectorFields` in the units of the file. frame.py
converts them to SI, grains.py and surface.py locate the grains, and conversion.py calls them all.
"""

from granpinn.importers.arrays import from_arrays
from granpinn.importers.conversion import convert
from granpinn.importers.reading import flow, read
from granpinn.importers.series import read_vectors
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

__all__ = [
    "DataFileError",
    "Settings",
    "Validity",
    "VectorFields",
    "convert",
    "flow",
    "from_arrays",
    "read",
    "read_vectors",
    "vector_fields",
]
