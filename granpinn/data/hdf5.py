"""HDF5 files of granpinn: flow files and fields.h5, as `granpinn.foreign.hdf5` reads them."""

from __future__ import annotations

import hashlib
import mmap
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.foreign import read_foreign
from granpinn.regular import RETRY, UnsafeFileError, open_regular_file

MOST_MAPPED = 2**37  # bytes of a file


# What an attribute must be, and how NumPy writes it.
_WORDS = {str: ("one text", "numpy.bytes_"), float: ("a number", "float64"), list: ("numbers",) * 2}


@dataclass(frozen=True)
class Attributes:
    """Attributes of a file or a dataset by name: text, a list of numbers, or `{"type": NAME}`."""

    values: dict[str, Any]

    def get(self, name: str, kind: type, required: bool = False) -> Any:
        """A text (str), one number (float) or all numbers (list); None if there is none.

        Raises:
            UnsafeFileError: it is of another kind, or it is required and missing.
        """
        value = self.values.get(name)
        if value is None and required:
            raise UnsafeFileError(
                f"the attribute {name} is missing: add it to the root of the file"
            )
        if kind is float and isinstance(value, list):
            if len(value) != 1:
                raise UnsafeFileError(
                    f"the attribute {name} must be one number, got {len(value)}: correct it"
                )
            return float(value[0])
        if value is None or isinstance(value, kind):
            return value
        found = value["type"] if isinstance(value, dict) else "text"
        if isinstance(value, list):
            found = f"{len(value)} numbers"
        expected, remedy = _WORDS[kind]
        raise UnsafeFileError(
            f"the attribute {name} must be {expected}, got {found}: write it as {remedy}"
        )


@dataclass(frozen=True)
class Dataset:
    """A dataset; `values` is None unless it holds numbers."""

    shape: tuple[int, ...]
    dtype: str
    attributes: Attributes
    values: npt.NDArray[Any] | None


@dataclass(frozen=True)
class Hdf5File:
    """What is read of a file; `datasets` holds those that exist."""

    attributes: Attributes
    datasets: dict[str, Dataset]
    sha256: str


def read_hdf5(path: Path, names: list[str], max_bytes: int, remedy: str) -> Hdf5File:
    """Reads some datasets of a regular file, and the attributes of its root.

    Args:
        max_bytes: of all arrays in memory. In a larger file those that are stored without chunks
            stay in the file, read-only; it must not change while they are used.
        remedy: for a file with more data.

    Raises:
        UnsafeFileError: the file breaks a rule of the container.
    """
    with open_regular_file(path, MOST_MAPPED) as stream:
        n_bytes = os.fstat(stream.fileno()).st_size
        in_place = n_bytes > max_bytes
        image = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if in_place else None
        request: dict[str, Any] = {"names": names, "remedy": remedy, "in_place": in_place}
        found = read_foreign("hdf5", path, n_bytes, max_bytes=max_bytes, **request)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()  # type: ignore[arg-type]
    datasets = {}
    for name, part in found["datasets"].items():
        values, shape = part.get("values"), tuple(part["shape"])
        if "place" in part:
            values = _mapped(image, part["dtype"], shape, part["place"])
        datasets[name] = Dataset(shape, part["dtype"], Attributes(part["attributes"]), values)
    return Hdf5File(Attributes(found["attributes"]), datasets, sha256)


def _mapped(image: Any, dtype: str, shape: tuple[int, ...], place: int | None) -> Any:
    """Numbers that lie in a mapped file."""
    count = int(np.prod(shape))
    if place is None or place + count * np.dtype(dtype).itemsize > len(image):
        raise UnsafeFileError(f"the file was cut off, expected a whole HDF5 file: {RETRY}")
    return np.frombuffer(image, dtype, count, place).reshape(shape)
