"""Readers of measurement files, and the way from their vectors to a flow.

One module per family of instruments gives `VectorFields` in the units of the file; frame.py makes
SI of them, grains.py and surface.py find where the grains are, conversion.py puts it together.
"""

from granpinn.importers.arrays import from_arrays
from granpinn.importers.conversion import convert
from granpinn.importers.reading import read
from granpinn.importers.series import read_vectors
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

__all__ = [
    "DataFileError",
    "Settings",
    "Validity",
    "VectorFields",
    "convert",
    "from_arrays",
    "read",
    "read_vectors",
    "vector_fields",
]
