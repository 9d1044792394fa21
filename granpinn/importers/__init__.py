"""Readers of measurement files, and the conversion of their vectors to a flow.

The files of this folder in the order in which a conversion passes them:

    series.py       files and patterns -> vectors of all frames, with their times; the table of
                    readers, which are chosen by the first bytes of a file
    columns.py      tables of text: names and units of columns; grids.py and tracks.py read them,
                    pivlab_mat.py and arrays.py other files. All give `VectorFields` (vectors.py),
                    in the units of the file; libraries open the files (limits.py)
    frame.py        units (units.py), axes and gravity -> `Frame`, which takes everything to SI;
                    what files and flags state twice must agree
    points.py       given lines of the surface and walls
    conversion.py   the whole chain; grains and surface (surface.py), settings -> `Flow`
"""

from granpinn.importers.arrays import from_arrays
from granpinn.importers.conversion import convert, flow, read
from granpinn.importers.series import read_vectors
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import DataFileError, Validity, VectorFields

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
]
