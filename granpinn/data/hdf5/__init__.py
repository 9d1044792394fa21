"""Safe access to a HDF5 file from an unknown source.

HDF5 files can point outside themselves (external links, external storage, virtual datasets),
can unpack to far more than they declare, and can hang the library in damaged variable-length
data. So the file is read into memory once and parsed there. The kind, type and size of an entry are
checked before it is read. HDF5 finds the entries; their bytes become numbers and text in this
package. It is the only reader of HDF5 files: flow files, fields.h5, MATLAB 7.3, netCDF4 and tracks.
"""

from granpinn.data.hdf5.file import SafeFile, open_hdf5

__all__ = ["SafeFile", "open_hdf5"]
