"""Readers of measurement files, and the conversion of their vectors to a flow.

The files of this folder in the order in which a conversion passes them:

    series.py       files and patterns -> one file after another
    formats.py      the format of a file, from its first bytes; the table of readers
    NAME.py         a reader gives `VectorFields`, in the units of the file (vectors.py). Text is
                    read by textfile.py (rows), columns.py (names, units), tables.py (grids);
                    other files by a library in the process of granpinn.foreign (limits.py)
    source.py       times, validity and frames of the vectors
    frame.py        units, axes and gravity -> `Frame`, which takes everything to SI (units.py)
    statements.py   what files and flags state twice must agree
    material.py     constants of the grains, from settings.py
    points.py       given lines of the surface and walls
    building.py     grains (grains.py), surface (surface.py, density.py) -> `Flow`

conversion.py is this chain; reading.py calls it from Python, granpinn/convert.py as a command.
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
