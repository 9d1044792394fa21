"""The arrays of an .npz file, which is a zip archive of .npy files.

Every declared size is compared with the others before memory is taken: the sizes of the members of
the archive, the shape and type in the header of each array, and the limits of all readers.
"""

from __future__ import annotations

import io
import math
import tokenize
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from granpinn.importers.limits import MAX_BYTES, open_file, require_room
from granpinn.importers.vectors import DataFileError

_KINDS = "fiubU"  # numbers and text
_MAX_TEXT = 2**16  # bytes
_MAX_HEADER = 4096
_MAX_MEMBERS = 64
_MAX_READ = 2**22
_EXCEPTIONS = (
    OSError,
    ValueError,  # also UnicodeDecodeError
    KeyError,
    IndexError,
    TypeError,
    EOFError,
    OverflowError,
    RuntimeError,  # encrypted members; also RecursionError and NotImplementedError
    MemoryError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def read_npz(path: Path) -> dict[str, Any]:
    """The arrays by name.

    Raises:
        DataFileError: the archive is damaged, too large, or holds other things than arrays of
            numbers and text.
    """
    try:
        with open_file(path, MAX_BYTES) as stream, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of NumPy, about headers of Python 2
            with zipfile.ZipFile(_Bounded(stream)) as archive:
                members = archive.infolist()
                if len(members) > _MAX_MEMBERS:
                    raise ValueError(f"it holds {len(members)} arrays")
                if len({_name(member) for member in members}) < len(members):
                    raise ValueError("it holds two arrays of one name")
                room = sum(_values(archive, member) for member in members)
                require_room(room, 8, path)
                return {_name(member): _array(archive, member) for member in members}
    except _EXCEPTIONS as error:
        if isinstance(error, DataFileError):
            raise
        raise DataFileError(
            f"{path} cannot be read as .npz ({str(error)[:160]}): write plain arrays with "
            "numpy.savez"
        ) from None


class _Bounded(io.RawIOBase):
    """A file that refuses large reads: zipfile reads the list of members in one piece."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def read(self, size: int = -1) -> bytes:
        found = self._stream.read(size if 0 <= size <= _MAX_READ else _MAX_READ + 1)
        if len(found) > _MAX_READ:
            raise ValueError(f"one part has more than {_MAX_READ} bytes")
        return found

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        return self._stream.tell()

    def seekable(self) -> bool:
        return True


def _name(member: zipfile.ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _values(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """How many numbers a member holds; its header must agree with its size."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }.get(version)
        if read is None:
            raise ValueError(f"version {version} of .npy")
        shape, _, dtype = read(stream, max_header_size=_MAX_HEADER)
        declared = math.prod(shape) * dtype.itemsize
        found = member.file_size - stream.tell()
    if dtype.kind not in _KINDS or dtype.hasobject or min(shape, default=0) < 0:
        raise ValueError(f"{_name(member)} is of type {dtype}")
    if declared != found:
        raise ValueError(f"{_name(member)} declares {declared} bytes and has {found}")
    if dtype.kind == "U" and declared > _MAX_TEXT:
        raise ValueError(f"{_name(member)} holds {declared} bytes of text")
    return math.prod(shape)


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Any:
    """The array of a member whose header was checked; NumPy unpickles no objects by default."""
    with archive.open(member) as stream:
        return np.lib.format.read_array(stream, max_header_size=_MAX_HEADER)
