"""Files and folders that the commands write: whole or not at all, and by one process at a time."""

from granpinn.output.hdf5 import hdf5_file
from granpinn.output.ownership import owned
from granpinn.output.targets import OutputError, make_folder, require_file
from granpinn.output.writing import naming, replacing, write_bytes, write_text

__all__ = [
    "OutputError",
    "hdf5_file",
    "make_folder",
    "naming",
    "owned",
    "replacing",
    "require_file",
    "write_bytes",
    "write_text",
]
