"""Plain arrays and cell arrays out of MATLAB files, of version 5 to 7 or 7.3 (which is HDF5)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.hdf5 import SafeFile
from granpinn.data.hdf5.dataset import Dataset
from granpinn.importers.mat5 import read_variables
from granpinn.importers.vectors import DataFileError
from granpinn.regular import UnsafeFileError, read_regular_file, too_large

MAX_BYTES = 2**31
MAX_TEXT = 1000
_ITEM = 8  # bytes of a number as float64
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_AT = (0, 512)  # at 512 after the header of MATLAB


class Matlab(Protocol):
    """Variables of a MATLAB file."""

    path: Path

    def __contains__(self, name: str) -> bool: ...

    def _numbers(self, name: str) -> Float64 | None:
        """A matrix of numbers, as MATLAB shows it; None for anything else."""

    def cells(self, name: str) -> list[Any]:
        """The matrices of a cell array in order, None for an empty one."""

    def cell_table(self, name: str) -> Any:
        """A two-dimensional cell array as an array of matrices."""

    def __getitem__(self, name: str) -> Float64:
        """A matrix of numbers."""
        matrix = self._numbers(name)
        if matrix is None:
            raise DataFileError(f"{self.path}: {name} must be a matrix of numbers, got none")
        return matrix

    def number(self, name: str, default: float) -> float:
        """A single number, `default` if there is none."""
        matrix = self._numbers(name) if name in self else None
        if matrix is not None and matrix.size != 1:
            raise DataFileError(f"{self.path}: {name} must be one number, got {matrix.size}")
        return default if matrix is None else float(matrix.flat[0])

    def text(self, name: str) -> str:
        """The characters of a variable, "" if there is none."""
        codes = self._numbers(name) if name in self else None
        if codes is None or codes.size > MAX_TEXT or not ((codes >= 0) & (codes < 128)).all():
            return ""
        return "".join(chr(int(code)) for code in codes.ravel(order="F"))


@contextmanager
def open_matlab(path: Path) -> Iterator[Matlab]:
    """The variables of a file; DataFileError if it is damaged or no MATLAB file."""
    try:
        content = read_regular_file(path, MAX_BYTES)
        if any(content[i : i + 8] == _HDF5 for i in _HDF5_AT):
            with SafeFile(content, MAX_BYTES) as file:
                yield _Hdf5(path, file)
        else:
            yield _Version5(path, content)
    except DataFileError:
        raise
    except UnsafeFileError as error:
        raise DataFileError(f"{path} cannot be read as a MATLAB file: {error}") from None
    except (ValueError, TypeError, LookupError, ArithmeticError) as error:
        reason = " ".join(str(error).split())[:160]
        raise DataFileError(
            f"{path} cannot be read as a MATLAB file ({reason}): it is damaged or something else"
        ) from None


def _matrix(value: Any) -> Float64 | None:
    """Numbers as float64 with two axes; None for an empty matrix."""
    array = np.asarray(value)  # of None: an object
    if array.dtype.kind not in "fiub" or array.size == 0:
        return None
    return np.atleast_2d(array.astype(np.float64))


class _Version5(Matlab):
    """Version 5 to 7."""

    def __init__(self, path: Path, content: bytes) -> None:
        self.path = path
        self._variables = read_variables(content, MAX_BYTES)
        self._taken = 0

    def _matrix(self, value: Any) -> Float64 | None:
        """Numbers as float64; all of them together within the limit of a file."""
        self._taken += np.size(value) * _ITEM
        if self._taken > MAX_BYTES:
            raise too_large(self._taken, MAX_BYTES)
        return _matrix(value)

    def __contains__(self, name: str) -> bool:
        return name in self._variables

    def _numbers(self, name: str) -> Float64 | None:
        return self._matrix(self._variables[name])

    def cells(self, name: str) -> list[Any]:
        value = self._variables[name]
        if value is None or value.dtype != object:
            return [self._matrix(value)]
        return [self._matrix(cell) for cell in value.ravel(order="F")]

    def cell_table(self, name: str) -> Any:
        value = self._variables[name]
        if value is None or value.dtype != object or value.ndim != 2:
            raise DataFileError(f"{self.path}: {name} must be a cell array, got something else")
        table = np.empty(value.shape, object)
        for index, cell in np.ndenumerate(value):
            table[index] = self._matrix(cell)
        return table


class _Hdf5(Matlab):
    """Version 7.3: arrays are stored transposed, cells as references, empty ones by attribute."""

    def __init__(self, path: Path, file: SafeFile) -> None:
        self.path, self._file = path, file

    def _dataset(self, name: str) -> Dataset:
        dataset = self._file.open_dataset(name)
        if dataset is None:
            raise DataFileError(f"{self.path}: {name} must be a variable of the file, got none")
        return dataset

    def _read(self, dataset: Dataset | None) -> Float64 | None:
        if dataset is None or dataset.dtype is None:
            return None
        empty = dataset.attributes.numbers("MATLAB_empty")
        if empty and empty[0]:
            return None
        matrix = _matrix(dataset.read("float64"))
        return None if matrix is None else matrix.T

    def _cells(self, dataset: Dataset) -> Any:
        references = dataset.references().T
        table = np.empty(references.shape, object)
        for index, reference in np.ndenumerate(references):
            table[index] = self._read(self._file.dereference(dataset.name, reference))
        return table

    def __contains__(self, name: str) -> bool:
        return self._file.holds(name)

    def _numbers(self, name: str) -> Float64 | None:
        return self._read(self._dataset(name))

    def cells(self, name: str) -> list[Any]:
        dataset = self._dataset(name)
        if not dataset.holds_references:
            return [self._read(dataset)]
        return list(self._cells(dataset).ravel(order="F"))

    def cell_table(self, name: str) -> Any:
        dataset = self._dataset(name)
        if not dataset.holds_references or len(dataset.layout.shape) != 2:
            raise DataFileError(
                f"{self.path}: {name} must be a cell array, got {dataset.layout.dtype}"
            )
        return self._cells(dataset)
