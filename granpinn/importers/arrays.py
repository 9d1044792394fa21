"""Arrays: an .npz file, a mapping in Python, or a data set of xarray.

t, y, x and u, v [T, Y, X]; or t, x, y, u, v [n] for scattered vectors; NaN for no vector.
Optional: validity (see `Validity`) or mask (true = masked out), sigma_u, sigma_v, c, p, chc; and as
text length_unit, time_unit, velocity_unit; and y_down.

A data set has the schema of pivpy: dimensions y, x, t; variables u, v, chc. chc: 1 to 4 measured
(number of the correlation peak), 5 and above interpolated, 0 nothing, below 0 rejected; some
writers put 0 into u and v there. `units` is an attribute of every variable. c, p, sigma_u and
sigma_v are optional.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import plain_array
from granpinn.importers.columns import Column, chosen, units_of
from granpinn.importers.limits import read_file, require_room
from granpinn.importers.vectors import (
    GAPS,
    NUMBERS,
    DataFileError,
    Validity,
    VectorFields,
    split_gaps,
)

REQUIRED = ("t", "y", "x", "u", "v")
TEXTS = ("length_unit", "time_unit", "velocity_unit")
CODES = ("validity", "mask", "chc", "y_down")
ARRAYS = (*REQUIRED, *NUMBERS[2:], *CODES)
INTERPOLATED_FROM = 5
VARIABLES = (*REQUIRED, *NUMBERS[2:], "chc")
_UNITLESS = ("chc", "p")  # a code, and a pressure that is kept for scoring only
DATASET = "the data set"


def read(path: Path) -> VectorFields:
    """All frames of an .npz file."""
    return from_arrays(read_file("npz", path), str(path))


def from_arrays(arrays: Mapping[str, Any], path: str = "the arrays") -> VectorFields:
    """Vector fields of a mapping of arrays."""
    missing = [name for name in REQUIRED if name not in arrays]
    if missing:
        raise DataFileError(
            f"{path} must hold {', '.join(REQUIRED)}, got no {', '.join(missing)}: add them"
        )
    known = {*ARRAYS, *TEXTS}
    unknown = sorted(set(arrays) - known)
    if unknown:
        raise DataFileError(
            f"{path} has the unknown array {unknown[0]}: expected {', '.join(sorted(known))}"
        )
    values = {n: _numbers(arrays, n, path) for n in ("t", "y", "x", *NUMBERS) if n in arrays}
    require_room(sum(a.size for a in values.values()), path)
    u, v = values["u"], values["v"]
    if u.shape != v.shape or u.ndim not in (1, 3):
        raise DataFileError(
            f"{path}: u and v must be [T, Y, X], or [n] for scattered vectors, got "
            f"{list(u.shape)} and {list(v.shape)}"
        )
    others: dict[str, Any] = {
        name: str(_one(arrays[name], name, path)) for name in TEXTS if name in arrays
    }
    if "y_down" in arrays:
        others["y_down"] = bool(_one(_numbers(arrays, "y_down", path, "fiub"), "y_down", path))
    if not {"validity", "mask", "c"} & arrays.keys():
        others["facts"] = {"mask": GAPS}
    codes = _codes(arrays, np.isfinite(u) & np.isfinite(v), path)
    return VectorFields(**values, validity=codes, **others)


def _numbers(arrays: Mapping[str, Any], name: str, path: str, kinds: str = "fiu") -> Any:
    return plain_array(arrays[name], f"{path}: {name}", DataFileError, kinds=kinds)


def _one(given: Any, name: str, path: str) -> Any:
    """The single value of an array or a plain value."""
    found = np.asarray(given)
    if found.size != 1:
        raise DataFileError(f"{path}: {name} must be one value, got {found.size}: correct it")
    return found.flat[0]


def _codes(arrays: Mapping[str, Any], finite: Any, path: str) -> Any:
    """Validity of the vectors; the gaps show the mask where nothing else does."""
    found = {n: _numbers(arrays, n, path, "fiub") for n in CODES[:3] if n in arrays}
    for name, values in found.items():
        if values.shape != finite.shape:
            raise DataFileError(
                f"{path}: {name} must have the shape {list(finite.shape)} of u, got "
                f"{list(values.shape)}"
            )
    chc = found.get("chc", np.where(finite, 1, 0))
    there = finite & (chc > 0)
    known = {"validity", "mask", "c"} & arrays.keys() or finite.ndim == 1
    codes = np.where(there, Validity.VALID, Validity.INVALID) if known else split_gaps(there)
    codes = np.array(found.get("validity", codes))  # not the array of a user
    if not np.isin(codes, list(Validity)).all():
        raise DataFileError(f"{path}: validity must be 0, 1, 2 or 3, got another number")
    if "chc" in found:
        codes[chc < 0] = Validity.INVALID
        codes[(chc >= INTERPOLATED_FROM) & finite] = Validity.INTERPOLATED
    masked = found.get("mask", np.zeros(1)).astype(bool)  # NaN, no value, is masked
    return np.where(masked, Validity.MASKED, codes)


def from_dataset(data: Any) -> VectorFields:
    """Vector fields of an xarray.Dataset, with the numbers that its attributes mean.

    Raises:
        DataFileError: a variable is missing, or its dimensions or attributes are wrong.
    """
    import xarray

    names = [name for name in VARIABLES if name in data.variables]
    require_room(sum(data[name].size for name in names), DATASET)
    try:
        data = xarray.decode_cf(data, decode_times=False)
    except (ValueError, TypeError) as error:
        raise DataFileError(f"the attributes of {DATASET} contradict it: {error}") from None
    timed = any("t" in data[name].dims for name in names)
    arrays: dict[str, Any] = {}
    named = []
    for name in names:
        wanted = (name,) if name in "xyt" else ("t", "y", "x")
        variable = data[name].variable
        values, dims = plain_array(variable.data, name, DataFileError), variable.dims
        if not timed and "t" in wanted:
            values, dims = values[None], ("t", *dims)
        if sorted(dims) != sorted(wanted):
            raise DataFileError(
                f"{DATASET}: {name} must have the dimensions {', '.join(wanted)}, got "
                f"{', '.join(map(str, dims))}: reduce or rename them"
            )
        arrays[name] = values.transpose([dims.index(dim) for dim in wanted])
        # pivpy writes "dt" for the time between the images of a pair.
        unit = str(variable.attrs.get("units", "")).replace("dt", "frame")
        named.append(Column(name, unit))
    _, stated = chosen(DATASET, named, {name: (name,) for name in arrays if name not in _UNITLESS})
    units = units_of(DATASET, stated)
    if "t" not in arrays and "u" in arrays:
        arrays["t"] = np.arange(len(arrays["u"]))
    if units["time_unit"] is None and (arrays["t"] == np.rint(arrays["t"])).all():
        units["time_unit"] = "frame"
    return from_arrays(arrays | {n: unit for n, unit in units.items() if unit}, DATASET)
