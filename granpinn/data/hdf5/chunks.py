"""Chunks of a dataset, unpacked here and not by HDF5.

HDF5 unpacks a chunk as far as it goes, to 1000 times the size of the file, and fills the rest of a
chunk that is too short with whatever its memory holds. Here a chunk has its declared size or is
refused. The filters gzip, shuffle and fletcher32 are those of the "HDF5 File Format Specification",
section IV.A.2.l.
"""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from operator import add, lt, mod
from typing import Any

import numpy as np
import numpy.typing as npt
from h5py import h5z

from granpinn.data.hdf5.content import Content
from granpinn.regular import UnsafeFileError

MAX_CHUNKS = 1_000_000
LARGE_CHUNK = 2**26  # bytes; a chunk above it may not be larger than the data
_FILTERS = (h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32)
_CHECKSUM_BYTES = 4
MOST_THREADS, LEAST_CHUNKS = 8, 2  # threads that unpack, and chunks for each of them
_MODULUS = 0xFFFF  # of both sums of fletcher32
_BLOCK = 2**20  # words whose sums fit into 64 bits


class Chunks:
    """The chunks of one dataset.

    Args:
        name: of the dataset, for messages.
        dataset, plan: its identifier and its creation properties.
        shape: of the dataset.
        dtype: of the stored values.
        file: it holds the dataset.
    """

    def __init__(
        self,
        name: str,
        dataset: Any,
        plan: Any,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        file: Content,
    ) -> None:
        self._name, self._dataset, self._file = name, dataset, file
        self._shape, self._dtype = shape, dtype
        self._chunk: tuple[int, ...] = plan.get_chunk()
        self._filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
        self._bytes = math.prod(self._chunk) * dtype.itemsize

    def read(self, array: npt.NDArray[Any]) -> bool:
        """Fills an array [shape] with all values; False if chunks are missing."""
        shape, chunk = self._shape, self._chunk
        expected = math.prod(-(-n // k) for n, k in zip(shape, chunk, strict=True))
        if expected > MAX_CHUNKS:
            raise UnsafeFileError(
                f"{self._name} must be stored in at most {MAX_CHUNKS} chunks, got {expected}: "
                "write it in chunks of whole frames"
            )
        if not set(self._filters) <= set(_FILTERS) or len(set(self._filters)) < len(self._filters):
            raise UnsafeFileError(
                f"{self._name} must be stored with gzip, shuffle and fletcher32 only, each at "
                f"most once, got the filters {self._filters}: write it again with gzip"
            )
        if self._bytes > max(math.prod(shape) * self._dtype.itemsize, LARGE_CHUNK):
            raise UnsafeFileError(
                f"{self._name} must be stored in chunks that are no larger than its data, got "
                f"chunks {list(chunk)} for values {list(shape)}: write it in chunks of whole frames"
            )
        stored: list[Any] = []
        self._dataset.chunk_iter(stored.append)
        places = {info.chunk_offset: info for info in stored if self._is_place(info.chunk_offset)}
        if len(places) != expected:
            return False
        raw = self._source(stored)

        def fill(some: list[tuple[int, ...]]) -> None:
            for place in some:
                content = self._unpacked(places[place], raw(places[place]))
                values = np.frombuffer(content, self._dtype).reshape(chunk)
                target = array[tuple(map(slice, place, map(add, place, chunk)))]
                whole = target.shape == chunk
                target[...] = values if whole else values[tuple(map(slice, target.shape))]

        every = list(places)
        threads = min(MOST_THREADS, len(os.sched_getaffinity(0)), len(every) // LEAST_CHUNKS)
        if threads < 2 or not self._filters:
            fill(every)
            return True
        # zlib leaves Python meanwhile. Each thread has its own part, so that errors keep an order.
        with ThreadPoolExecutor(threads) as pool:
            for _ in pool.map(fill, [every[k::threads] for k in range(threads)]):
                pass
        return True

    def _is_place(self, offset: tuple[int, ...]) -> bool:
        inside = min(offset) >= 0 and all(map(lt, offset, self._shape))
        return inside and not any(map(mod, offset, self._chunk))

    def _source(self, stored: Sequence[Any]) -> Callable[[Any], bytes | memoryview]:
        """How the stored bytes of a chunk are found.

        The list of chunks says where they lie. Some versions of HDF5 forget the user block there;
        then HDF5 looks up each chunk, which takes longer.
        """
        if any(info.size > self._file.n_bytes for info in stored):
            raise self._wrong_size(max(info.size for info in stored))

        def looked_up(info: Any) -> bytes:
            content: bytes = self._dataset.read_direct_chunk(info.chunk_offset)[1]
            return content

        def listed(info: Any) -> memoryview:
            return self._file.content(info.byte_offset, info.size)

        same = all(listed(info) == looked_up(info) for info in stored[:1])
        return listed if same else looked_up

    def _unpacked(self, info: Any, content: bytes | memoryview) -> bytes | memoryview:
        """The values of a chunk: its filters backwards, but those that the chunk leaves out."""
        applied = self._filters
        if info.filter_mask:
            applied = [f for i, f in enumerate(applied) if not info.filter_mask >> i & 1]
        for i in reversed(range(len(applied))):
            code = applied[i]
            if code == h5z.FILTER_DEFLATE:
                inner = _CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in applied[:i])
                content = zlib.decompressobj().decompress(content, self._bytes + inner + 1)
            elif code == h5z.FILTER_FLETCHER32:
                content = self._checked(content)
            else:
                content = self._unshuffled(content)
        if len(content) != self._bytes:
            raise self._wrong_size(len(content))
        return content

    def _checked(self, content: bytes | memoryview) -> bytes | memoryview:
        data, stored = content[:-_CHECKSUM_BYTES], content[-_CHECKSUM_BYTES:]
        if fletcher32(data) != int.from_bytes(stored, "little"):
            raise UnsafeFileError(
                f"{self._name} must have chunks that match their checksum, got another: the file "
                "is damaged, make it again"
            )
        return data

    def _unshuffled(self, content: bytes | memoryview) -> bytes | memoryview:
        """Shuffled bytes: the first of all values, then the second of all values, and so on."""
        if len(content) != self._bytes:
            raise self._wrong_size(len(content))
        parts = np.frombuffer(content, np.uint8).reshape(self._dtype.itemsize, -1)
        values = np.empty(parts.shape[::-1], np.uint8)
        for k, part in enumerate(parts):  # faster than a copy of the transpose
            values[:, k] = part
        return values.data.cast("B")

    def _wrong_size(self, size: int) -> UnsafeFileError:
        return UnsafeFileError(
            f"{self._name} must have chunks of {self._bytes} bytes as declared, got one of "
            f"{size if size < self._bytes else 'more'}: the file is damaged, make it again"
        )


def fletcher32(data: bytes | memoryview) -> int:
    """The checksum of HDF5: sums of big-endian 16-bit words, and of these sums, modulo 65535."""
    padded = bytes(data) + bytes(len(data) % 2)
    words = np.frombuffer(padded, ">u2")
    first, second = 0, 0
    for start in range(0, words.size, _BLOCK):
        block = words[start : start + _BLOCK].astype(np.uint64)
        weights = np.arange(block.size, 0, -1, dtype=np.uint64)
        second += block.size * first + int((weights * block).sum())
        first += int(block.sum())
    return _folded(second) << 16 | _folded(first)


def _folded(total: int) -> int:
    """The total modulo 65535, where a total above 0 stays above 0."""
    return total % _MODULUS or (_MODULUS if total else 0)
