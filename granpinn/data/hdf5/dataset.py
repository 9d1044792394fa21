"""One dataset of a file from an unknown source: its storage, its layout and its data.

The bytes of a dataset are taken from the file as they are and become numbers in NumPy. HDF5 itself
converts nothing, so it neither follows variable-length data nor leaves memory unwritten.
"""

from __future__ import annotations

import math
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
from h5py import h5d, h5s, h5t

from granpinn.data.format import Layout
from granpinn.data.hdf5.attributes import Attributes
from granpinn.data.hdf5.chunks import Chunks
from granpinn.data.hdf5.content import Content
from granpinn.data.hdf5.kinds import damage, describe, is_fixed_string, row_dtype, stored_dtype
from granpinn.regular import UnsafeFileError

_REFERENCE_BYTES = 100  # of one reference as an object of h5py


class Dataset:
    """A dataset whose layout is known; `read` reads its data."""

    def __init__(self, name: str, dataset: Any, file: Content) -> None:
        self.name = name
        self._dataset, self._file = dataset, file
        self._plan = dataset.get_create_plist()
        # The storage comes first: reading the shape of a virtual dataset opens other files.
        self._chunked = self._plan.get_layout() == h5d.CHUNKED
        if self._plan.get_layout() == h5d.VIRTUAL or self._plan.get_external_count() > 0:
            raise UnsafeFileError(
                f"{name} must be stored in the file itself, got data in another file (virtual "
                "or external storage): copy the data into the file"
            )
        kind, space = dataset.get_type(), dataset.get_space()
        if space.get_simple_extent_type() == h5s.NULL:
            raise UnsafeFileError(f"{name} must be an array, got an empty dataset: store the data")
        self._kind = kind
        self._itemsize: int = kind.get_size()
        self.layout = Layout(tuple(space.shape), describe(kind))
        self.attributes = Attributes(dataset, file)

    @property
    def n_bytes(self) -> int:
        """Size of the data."""
        return self._itemsize * math.prod(self.layout.shape)

    @property
    def n_bytes_needed(self) -> int:
        """Memory that reading takes: the data, or one chunk if that is larger."""
        chunk: tuple[int, ...] = self._plan.get_chunk() if self._chunked else (0,)
        return max(self.n_bytes, self._itemsize * math.prod(chunk))

    def is_in_place(self, dtype: str) -> bool:
        """Whether `read` as a type gives the pages of a mapped file, read-only, and no copy."""
        contiguous = self._plan.get_layout() == h5d.CONTIGUOUS
        return self._file.is_mapped and contiguous and self.dtype == np.dtype(dtype)

    @property
    def address(self) -> int:
        """Place of its object header, by which references name it."""
        return self._file.address(self._dataset)

    @property
    def dtype(self) -> np.dtype[Any] | None:
        """The NumPy type of stored numbers; None if it holds something else."""
        return stored_dtype(self._kind)

    @property
    def holds_text(self) -> bool:
        """Whether it holds fixed-length strings."""
        return is_fixed_string(self._kind)

    @property
    def is_table(self) -> bool:
        """Whether it has rows with columns, a compound type."""
        return bool(self._kind.get_class() == h5t.COMPOUND)

    @property
    def holds_references(self) -> bool:
        """Whether it names other objects of the file."""
        return bool(self._kind.equal(h5t.STD_REF_OBJ))

    def read(self, dtype: str | None = None) -> npt.NDArray[Any]:
        """All of the data, after a check that the file really holds it.

        Args:
            dtype: of the result; None for the type in the file.
        """
        with damage(self.name):
            stored = row_dtype(self._kind) if self.is_table else self.dtype
            if stored is None:
                raise UnsafeFileError(
                    f"{self.name} must hold numbers of 1, 2, 4 or 8 bytes, got {self.layout.dtype}"
                    ": write it as float64"
                )
            return self._read(stored, np.dtype(dtype) if dtype else stored)

    def references(self) -> npt.NDArray[Any]:
        """The references, of h5py, as `SafeFile.dereference` takes them."""
        with damage(self.name):
            if not self.holds_references:
                raise UnsafeFileError(
                    f"{self.name} must hold references, got {describe(self._kind)}: make it again"
                )
            if self._plan.get_layout() != h5d.COMPACT:
                self._read(np.dtype("<u8"), np.dtype("<u8"))  # the check of storage and chunks
            self._file.take(_REFERENCE_BYTES * math.prod(self.layout.shape))
            array = np.empty(self.layout.shape, dtype=h5py.ref_dtype)
            self._dataset.read(h5s.ALL, h5s.ALL, array)
            return array

    def _read(self, stored: np.dtype[Any], wanted: np.dtype[Any]) -> npt.NDArray[Any]:
        shape, in_place = self.layout.shape, stored == wanted and self.is_in_place(wanted.str)
        if not in_place:
            self._file.take(max(self.n_bytes_needed, wanted.itemsize * math.prod(shape)))
        # A number beyond the range of the wanted type becomes infinite, as in HDF5.
        with np.errstate(over="ignore", invalid="ignore"):
            if self._chunked:
                array = np.empty(shape, wanted)
                chunks = Chunks(self.name, self._dataset, self._plan, shape, stored, self._file)
                if not chunks.read(array):
                    raise self._incomplete()
                return array
            if self._dataset.get_storage_size() != self.n_bytes:
                raise self._incomplete()
            if self._plan.get_layout() == h5d.COMPACT and not self.is_table:
                array = np.empty(shape, stored)
                self._dataset.read(h5s.ALL, h5s.ALL, array, self._kind)
            else:
                content = self._file.content(self._dataset.get_offset() or 0, self.n_bytes)
                array = np.frombuffer(content, stored).reshape(shape)
            return array.astype(wanted, copy=not in_place)

    def _incomplete(self) -> UnsafeFileError:
        return UnsafeFileError(
            f"{self.name} must hold the {list(self.layout.shape)} values that it declares, got "
            "fewer: the file was not written to its end, make it again"
        )
