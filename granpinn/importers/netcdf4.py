"""The variables of a netCDF4 file, which is HDF5, for xarray.

netCDF4 keeps its dimensions as dimension scales: the attribute DIMENSION_LIST of a variable names
the scale of every axis. xarray decodes the values by their attributes, as it does for any file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from granpinn.data.hdf5 import open_hdf5
from granpinn.data.hdf5.attributes import Attributes
from granpinn.data.hdf5.dataset import Dataset
from granpinn.regular import UnsafeFileError

# Attributes that change the meaning of the numbers, and the unit.
NUMBERS = ("_FillValue", "missing_value", "scale_factor", "add_offset")
TEXTS = ("_Unsigned", "dtype", "units")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."


def read_variables(
    path: Path, names: tuple[str, ...], facts: tuple[str, ...], max_bytes: int
) -> tuple[dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]], dict[str, Any]]:
    """Dimensions, stored array and attributes of each variable that the file has, and the facts.

    Args:
        names: of the variables.
        facts: names of attributes of the file.
        max_bytes: of the file, and of all arrays.

    Raises:
        UnsafeFileError: the file breaks a rule of the container.
    """
    with open_hdf5(path, max_bytes) as file:
        scales = file.addresses()
        found = {}
        for name in names:
            dataset = file.open_dataset(name)
            if dataset is not None and not _only_a_dimension(dataset):
                dims = _dimensions(dataset, scales)
                found[name] = (dims, dataset.read(), _attributes(dataset.attributes, TEXTS))
        return found, _attributes(file.attributes, facts)


def _only_a_dimension(dataset: Dataset) -> bool:
    """Whether a dataset stands for an axis without coordinates, and holds no numbers."""
    return (dataset.attributes.any_text("NAME") or "").startswith(_NO_VARIABLE)


def _dimensions(dataset: Dataset, scales: dict[int, str]) -> tuple[str, ...]:
    n_axes = len(dataset.layout.shape)
    lists = dataset.attributes.references("DIMENSION_LIST")
    if not lists and n_axes == 1 and dataset.attributes.any_text("CLASS") == "DIMENSION_SCALE":
        return (dataset.name,)
    if len(lists) != n_axes or not set(lists) <= scales.keys():
        raise UnsafeFileError(
            f"{dataset.name} must have a dimension for each of its {n_axes} axes, got "
            f"{len(lists)}: write it with xarray"
        )
    return tuple(scales[address] for address in lists)


def _attributes(attributes: Attributes, texts: tuple[str, ...]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in (*NUMBERS, *texts):
        numbers = attributes.array(name)
        value = attributes.any_text(name) if numbers is None else numbers
        if numbers is not None and numbers.size == 1:
            value = numbers.reshape(-1)[0]
        if value is not None:
            found[name] = value
    return found
