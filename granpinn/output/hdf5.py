"""HDF5 files on a disk that may be full.

HDF5 crashes the process when it cannot write while it closes a file. So a file is made in memory.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager

import h5py

from granpinn.output.writing import write_bytes


@contextmanager
def hdf5_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """Yield a HDF5 file that replaces `path` once it is complete; OutputError if it cannot."""
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        yield file
    write_bytes(path, content.getbuffer())
