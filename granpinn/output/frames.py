"""The frames of an HDF5 dataset, compressed by several threads.

HDF5 compresses a chunk when it writes it, one after the other. Here threads shuffle and compress
the chunks, since NumPy and zlib leave Python meanwhile, and HDF5 stores them as they are. The bytes
are those of its filters shuffle and gzip.
"""

from __future__ import annotations

import os
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

LEVEL = 2  # of gzip: 2 % larger than at 4, the usual one, in 60 % of the time
PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True}
MOST = 8  # threads: HDF5 stores the chunks of no more
AHEAD = 4  # frames for each thread that wait to be stored


class Packer:
    """Threads that compress the frames of datasets."""

    def __init__(self, pool: ThreadPoolExecutor, ahead: int) -> None:
        self._pool, self._ahead = pool, ahead

    def write(self, dataset: h5py.Dataset, frame: Callable[[int], npt.NDArray[Any]]) -> None:
        """Write all frames of a dataset with the filters `PACKED` and chunks of one frame.

        Args:
            frame: the values at frame k; threads call it.
        """
        dtype, count = dataset.dtype, len(dataset)
        first = (0,) * (dataset.ndim - 1)
        waiting: deque[tuple[int, Future[bytes]]] = deque()
        for k in range(count):
            waiting.append((k, self._pool.submit(lambda k: packed(frame(k), dtype), k)))
            while len(waiting) > (self._ahead if k + 1 < count else 0):
                place, content = waiting.popleft()
                dataset.id.write_direct_chunk((place, *first), content.result())


@contextmanager
def packer() -> Iterator[Packer]:
    """Yield a packer with a thread for every core at hand."""
    threads = min(MOST, len(os.sched_getaffinity(0)))
    pool = ThreadPoolExecutor(threads)
    try:
        yield Packer(pool, AHEAD * threads)
    finally:
        pool.shutdown(cancel_futures=True)


def packed(values: npt.NDArray[Any], dtype: np.dtype[Any]) -> bytes:
    """A chunk as the filters of HDF5 leave it: the first bytes of all values, then the second bytes
    of all values, and so on, compressed."""
    flat = np.ascontiguousarray(values, dtype).reshape(-1)
    parts = flat.view(np.uint8).reshape(-1, dtype.itemsize)
    return zlib.compress(np.ascontiguousarray(parts.T).data, LEVEL)
