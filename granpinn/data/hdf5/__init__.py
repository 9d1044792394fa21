"""Safe access to a HDF5 file from an unknown source.

HDF5 files can point outside themselves (external links, external storage, virtual datasets),
can unpack to far more than they declare, and can hang the library in damaged variable-length
data. So the file is read into memory once and parsed there. The kind, type and size of an entry are
checked before it is read. Only plain numbers and fixed-length strings are read.
"""

from granpinn.data.hdf5.file import SafeFile, read_regular_file, too_large

__all__ = ["SafeFile", "read_regular_file", "too_large"]
