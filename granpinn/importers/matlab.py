"""Plain arrays and cell arrays out of MATLAB files, of version 5 to 7 or 7.3 (which is HDF5)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.mat5 import read_variables
from granpinn.importers.vectors import DataFileError

MAX_BYTES = 2**31
MAX_TEXT = 1000
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
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DataFileError(f"{path} must be at most 2 GiB: save fewer frames in one file")
        with path.open("rb") as stream:
            head = stream.read(1024)
        if any(head[i : i + 8] == _HDF5 for i in _HDF5_AT):
            with h5py.File(path, "r") as file:
                yield _Hdf5(path, file)
        else:
            yield _Version5(path)
    except DataFileError:
        raise
    except FileNotFoundError:
        raise DataFileError(f"{path} does not exist: check the path") from None
    except (OSError, ValueError, TypeError, KeyError, RuntimeError, NotImplementedError) as error:
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

    def __init__(self, path: Path) -> None:
        self.path = path
        self._variables = read_variables(path.read_bytes(), MAX_BYTES)

    def __contains__(self, name: str) -> bool:
        return name in self._variables

    def _numbers(self, name: str) -> Float64 | None:
        return _matrix(self._variables[name])

    def cells(self, name: str) -> list[Any]:
        value = self._variables[name]
        if value is None or value.dtype != object:
            return [_matrix(value)]
        return [_matrix(cell) for cell in value.ravel(order="F")]

    def cell_table(self, name: str) -> Any:
        value = self._variables[name]
        if value is None or value.dtype != object or value.ndim != 2:
            raise DataFileError(f"{self.path}: {name} must be a cell array, got something else")
        table = np.empty(value.shape, object)
        for index, cell in np.ndenumerate(value):
            table[index] = _matrix(cell)
        return table


class _Hdf5(Matlab):
    """Version 7.3: arrays are stored transposed, cells as references, empty ones by attribute."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path, self._file = path, file

    def _dataset(self, name: str) -> h5py.Dataset:
        link = self._file.get(name, getlink=True)
        dataset = self._file[name] if isinstance(link, h5py.HardLink) else None
        if not isinstance(dataset, h5py.Dataset) or dataset.is_virtual or dataset.external:
            raise DataFileError(f"{self.path}: {name} must be an array stored in the file itself")
        return dataset

    def _read(self, dataset: Any) -> Float64 | None:
        if not isinstance(dataset, h5py.Dataset) or dataset.attrs.get("MATLAB_empty", 0):
            return None
        if dataset.dtype.kind not in "fiub":
            return None
        if dataset.size * 8 > MAX_BYTES:
            raise DataFileError(f"{self.path} must declare at most 2 GiB of data: split it")
        matrix = _matrix(dataset[()])
        return None if matrix is None else matrix.T

    def _cells(self, dataset: h5py.Dataset) -> Any:
        references = dataset[()].T
        table = np.empty(references.shape, object)
        for index, reference in np.ndenumerate(references):
            table[index] = self._read(self._file[reference]) if reference else None
        return table

    def __contains__(self, name: str) -> bool:
        return name in self._file

    def _numbers(self, name: str) -> Float64 | None:
        return self._read(self._dataset(name))

    def cells(self, name: str) -> list[Any]:
        dataset = self._dataset(name)
        if h5py.check_ref_dtype(dataset.dtype) is None:
            return [self._read(dataset)]
        return list(self._cells(dataset).ravel(order="F"))

    def cell_table(self, name: str) -> Any:
        dataset = self._dataset(name)
        if h5py.check_ref_dtype(dataset.dtype) is None or dataset.ndim != 2:
            raise DataFileError(f"{self.path}: {name} must be a cell array, got {dataset.dtype}")
        return self._cells(dataset)
