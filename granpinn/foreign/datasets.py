"""Data sets of netCDF, by xarray: version 3 with scipy, version 4, HDF5, with h5py."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray

from granpinn.arrays import plain_array
from granpinn.foreign import hdf5
from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError

LIBRARY = "xarray"
# Attributes that change the meaning of the numbers, and the unit.
DECODED = ("_FillValue", "missing_value", "scale_factor", "add_offset", "_Unsigned", "dtype")
_NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable."


def read(path: Path, answer: Answer, names: list[str]) -> dict[str, Any]:
    """Variables of these names that exist, as `variables_of` gives them, and the attribute
    `delta_t` as text."""
    with _opened(path, answer, names) as data:
        answer.require(sum(8 * data[name].size for name in names if name in data.variables))
        variables = variables_of(data, names)
        for variable in variables.values():
            variable["values"] = answer.keep(variable["values"])
        return {"variables": variables, "delta_t": str(data.attrs.get("delta_t", ""))}


def variables_of(data: xarray.Dataset, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """`values` in float64, `dims` and `unit` of each variable of these names, with the numbers that
    its attributes mean, such as scale_factor.

    Raises:
        UnsafeFileError: attributes contradict each other.
        BadInput: an array holds no numbers.
    """
    try:
        data = xarray.decode_cf(data, decode_times=False)
    except (ValueError, TypeError) as error:
        raise UnsafeFileError(f"the attributes of the data set contradict it: {error}") from None
    variables = {name: data[name].variable for name in names if name in data.variables}
    return {
        name: {
            "dims": [str(dim) for dim in variable.dims],
            "unit": str(variable.attrs.get("units", "")),
            "values": plain_array(variable.data, name).astype(np.float64),
        }
        for name, variable in variables.items()
    }


def _opened(path: Path, answer: Answer, names: list[str]) -> Any:
    if not h5py.is_hdf5(path):
        return xarray.open_dataset(path, engine="scipy", decode_times=False)
    with hdf5.opened(path) as file:
        datasets = {name: hdf5.dataset_of(file, name) for name in names}
        stored = {n: d for n, d in datasets.items() if d is not None and not _is_empty(d)}
        answer.require(sum(8 * dataset.size for dataset in stored.values()))
        variables = {name: _variable(name, dataset) for name, dataset in stored.items()}
        return xarray.Dataset(variables, attrs=_attributes(file, ("delta_t",)))


def _variable(name: str, dataset: h5py.Dataset) -> xarray.Variable:
    """A variable of netCDF-4: scales, which are datasets, name its dimensions."""
    if dataset.is_scale and dataset.ndim == 1:
        dims = [name]
    else:
        dims = [dim[0].name.rpartition("/")[2] for dim in dataset.dims if len(dim)]
    if len(dims) != dataset.ndim:
        raise UnsafeFileError(
            f"{name} must have a dimension for each of its {dataset.ndim} axes, got {len(dims)}: "
            "write it with xarray"
        )
    return xarray.Variable(
        dims, hdf5.values(name, dataset), _attributes(dataset, (*DECODED, "units"))
    )


def _is_empty(dataset: h5py.Dataset) -> bool:
    """Whether a dataset stands for an axis without coordinates, and holds no numbers."""
    return bytes(dataset.attrs.get("NAME", b"")).startswith(_NO_VARIABLE)


def _attributes(item: Any, names: tuple[str, ...]) -> dict[str, Any]:
    found = {name: item.attrs[name] for name in names if name in item.attrs}
    single = {name: np.ravel(value)[0] for name, value in found.items() if np.size(value) == 1}
    return found | single
