"""HDF5 files on a disk that may be full.

HDF5 crashes the process when it cannot write while it closes a file. It therefore writes through
`_Stream`, which notes the first failure and goes on in memory. The failure is raised once HDF5 has
closed the file.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import h5py

from granpinn.output.writing import replacing


@contextmanager
def hdf5_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """Yield a HDF5 file that replaces `path` once it is complete; OutputError if it cannot."""
    with replacing(path) as temporary:
        with temporary.open("r+b", buffering=0) as raw:
            stream = _Stream(raw)
            with h5py.File(stream, "w") as file:
                yield file
        if stream.failed is not None:
            raise stream.failed


class _Stream(io.RawIOBase):
    """A binary file that never fails HDF5: after the first failure its content is in memory."""

    def __init__(self, raw: BinaryIO | io.RawIOBase) -> None:
        self.failed: OSError | None = None
        self._file: Any = raw

    def _attempt(self, work: Callable[[Any], Any]) -> Any:
        position = self._file.tell()
        try:
            return work(self._file)
        except OSError as error:
            if self.failed is not None:
                raise
            self.failed = error
            self._file.seek(0)
            self._file = io.BytesIO(self._file.read())
            self._file.seek(position)
            return work(self._file)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")

        def whole(file: Any) -> int:
            done = 0
            while done < len(view):  # a raw file may write less than it is given
                done += file.write(view[done:])
            return done

        return int(self._attempt(whole))

    def truncate(self, size: int | None = None) -> int:
        def resize(file: Any) -> int:
            if isinstance(file, io.BytesIO) and size is not None:
                missing = size - len(file.getbuffer())
                if missing > 0:
                    place = file.tell()
                    file.seek(0, os.SEEK_END)
                    file.write(bytes(missing))
                    file.seek(place)
            return int(file.truncate(size))

        return int(self._attempt(resize))

    def readinto(self, buffer: Any) -> int:
        return int(self._file.readinto(buffer) or 0)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return int(self._file.seek(offset, whence))

    def tell(self) -> int:
        return int(self._file.tell())

    def flush(self) -> None:
        """Nothing is buffered; `replacing` forces the content to the disk."""
