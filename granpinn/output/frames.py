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


Frame = Callable[[int], npt.NDArray[Any]]  # the values at frame k; threads call it


@contextmanager
def packer() -> Iterator[Callable[[h5py.Dataset, Frame], None]]:
    """Yield a function that writes all frames of a dataset, with a thread for every core at hand.

    The dataset has the filters `PACKED` and chunks of one frame.
    """
    threads = min(MOST, len(os.sched_getaffinity(0)))
    pool = ThreadPoolExecutor(threads)

    def write(dataset: h5py.Dataset, frame: Frame) -> None:
        dtype, count = dataset.dtype, len(dataset)
        first = (0,) * (dataset.ndim - 1)
        waiting: deque[tuple[int, Future[bytes]]] = deque()
        for k in range(count):
            waiting.append((k, pool.submit(lambda k: packed(frame(k), dtype), k)))
            while len(waiting) > (AHEAD * threads if k + 1 < count else 0):
                place, content = waiting.popleft()
                dataset.id.write_direct_chunk((place, *first), content.result())

    try:
        yield write
    finally:
        pool.shutdown(cancel_futures=True)


def packed(values: npt.NDArray[Any], dtype: np.dtype[Any]) -> bytes:
    """A chunk as the filters of HDF5 leave it: the first bytes of all values, then the second bytes
    of all values, and so on, compressed."""
    flat = np.ascontiguousarray(values, dtype).reshape(-1)
    parts = flat.view(np.uint8).reshape(-1, dtype.itemsize)
    return zlib.compress(np.ascontiguousarray(parts.T).data, LEVEL)
