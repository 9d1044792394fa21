"""One dataset of a file from an unknown source: its storage, its layout and its data."""

from __future__ import annotations

import math
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt
from h5py import h5d, h5s, h5z

from granpinn.data.flow import FlowFileError
from granpinn.data.format import Layout
from granpinn.data.hdf5.kinds import damage, describe

MAX_CHUNKS = 1_000_000
_CHECKSUM_BYTES = 4
_FILTERS = (h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32)


class Dataset:
    """A dataset whose layout is known; `read` reads its data."""

    def __init__(self, name: str, dataset: Any, file_bytes: int) -> None:
        self.name = name
        self._dataset = dataset
        self._file_bytes = file_bytes
        self._plan = dataset.get_create_plist()
        # The storage comes first: reading the shape of a virtual dataset opens other files.
        self._chunked = self._plan.get_layout() == h5d.CHUNKED
        if self._plan.get_layout() == h5d.VIRTUAL or self._plan.get_external_count() > 0:
            raise FlowFileError(
                f"{name} must be stored in the file itself, got data in another file (virtual "
                "or external storage): copy the data into the file"
            )
        kind, space = dataset.get_type(), dataset.get_space()
        if space.get_simple_extent_type() == h5s.NULL:
            raise FlowFileError(f"{name} must be an array, got an empty dataset: store the data")
        self._itemsize: int = kind.get_size()
        self.layout = Layout(tuple(space.shape), describe(kind))

    @property
    def n_bytes(self) -> int:
        """Size of the data."""
        return self._itemsize * math.prod(self.layout.shape)

    @property
    def n_bytes_needed(self) -> int:
        """Memory that reading takes: the data, or one chunk if that is larger."""
        return max(self.n_bytes, self._chunk_bytes)

    @property
    def _chunk_bytes(self) -> int:
        chunk: tuple[int, ...] = self._plan.get_chunk() if self._chunked else (0,)
        return self._itemsize * math.prod(chunk)

    def read(self, dtype: str) -> npt.NDArray[Any]:
        """All of the data, after a check that the file really holds it.

        Args:
            dtype: of the result.
        """
        with damage(self.name):
            if self._chunked:
                self._check_chunks()
            elif self._dataset.get_storage_size() != self.n_bytes:
                raise self._incomplete()
            array = np.empty(self.layout.shape, dtype=dtype)
            self._dataset.read(h5s.ALL, h5s.ALL, array)
            return array

    def _incomplete(self) -> FlowFileError:
        return FlowFileError(
            f"{self.name} must hold the {list(self.layout.shape)} values that it declares, got "
            "fewer: the file was not written to its end, make it again"
        )

    def _check_chunks(self) -> None:
        """Raises an error unless every chunk exists and unpacks to exactly its declared size.

        HDF5 itself unpacks a chunk as far as it goes, to 1000 times the size of the file.
        """
        shape, chunk = self.layout.shape, self._plan.get_chunk()
        expected = math.prod(-(-n // k) for n, k in zip(shape, chunk, strict=True))
        if expected > MAX_CHUNKS:
            raise FlowFileError(
                f"{self.name} must be stored in at most {MAX_CHUNKS} chunks, got {expected}: "
                "write it in chunks of whole frames"
            )
        filters = [self._plan.get_filter(i)[0] for i in range(self._plan.get_nfilters())]
        if not set(filters) <= set(_FILTERS) or len(set(filters)) < len(filters):
            raise FlowFileError(
                f"{self.name} must be stored with gzip, shuffle and fletcher32 only, each at "
                f"most once, got the filters {filters}: write it again with gzip"
            )
        stored: list[Any] = []
        self._dataset.chunk_iter(stored.append)
        if len({info.chunk_offset for info in stored}) != expected:
            raise self._incomplete()
        for info in stored:
            self._check_chunk(info, filters)

    def _check_chunk(self, info: Any, filters: list[int]) -> None:
        """The filters run in order when data is written: shuffle, gzip, checksum as a rule."""
        applied = [f for i, f in enumerate(filters) if not info.filter_mask >> i & 1]
        packed = h5z.FILTER_DEFLATE in applied
        first = applied[: applied.index(h5z.FILTER_DEFLATE)] if packed else applied
        expected = self._chunk_bytes + _CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in first)
        size = info.size
        if packed and size <= self._file_bytes:
            _, raw = self._dataset.read_direct_chunk(info.chunk_offset)
            size = len(zlib.decompressobj().decompress(raw, expected + 1))
        if size != expected:
            raise FlowFileError(
                f"{self.name} must have chunks of {expected} bytes as declared, got one of "
                f"{size if size < expected else 'more'}: the file is damaged, make it again"
            )
