"""HDF5 files on a disk that may be full, and the frames of their datasets.

HDF5 crashes the process when it cannot write while it closes a file. So a file is made in memory.

HDF5 compresses a chunk when it writes it, one after the other. Here threads shuffle and compress
the chunks, since NumPy and zlib leave Python meanwhile, and HDF5 stores them as they are. The bytes
are those of its filters shuffle and gzip.
"""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from granpinn.output.writing import write_bytes

LEVEL = 2  # of gzip: 2 % larger than at 4, the usual one, in 60 % of the time
PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True}
MOST = 8  # threads: HDF5 stores the chunks of no more
AHEAD = 4  # frames for each thread in memory


Frame = Callable[[int], npt.NDArray[Any]]  # the values at frame k; threads call it


@contextmanager
def hdf5_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """Yield a HDF5 file that replaces `path` once it is complete; OutputError if it cannot."""
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        yield file
    write_bytes(path, content.getbuffer())


def write_frames(dataset: h5py.Dataset, frame: Frame) -> None:
    """Write all frames of a dataset, with a thread for every core at hand.

    The dataset has the filters `PACKED` and chunks of one frame.
    """
    threads, count = min(MOST, len(os.sched_getaffinity(0))), len(dataset)
    dtype, within = dataset.dtype, (0,) * (dataset.ndim - 1)
    with ThreadPoolExecutor(threads) as pool:
        for first in range(0, count, AHEAD * threads):
            some = range(first, min(first + AHEAD * threads, count))
            contents = pool.map(lambda k: packed(frame(k), dtype), some)
            for k, content in zip(some, contents, strict=True):
                dataset.id.write_direct_chunk((k, *within), content)


def packed(values: npt.NDArray[Any], dtype: np.dtype[Any]) -> bytes:
    """A chunk as the filters of HDF5 leave it: the first bytes of all values, then the second bytes
    of all values, and so on, compressed."""
    flat = np.ascontiguousarray(values, dtype).reshape(-1)
    parts = flat.view(np.uint8).reshape(-1, dtype.itemsize)
    return zlib.compress(np.ascontiguousarray(parts.T).data, LEVEL)
