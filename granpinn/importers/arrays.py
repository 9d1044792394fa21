"""Arrays: an .npz file, a mapping in Python, or a data set of xarray.

t, y, x and u, v [T, Y, X]; or t, x, y, u, v [n] for scattered vectors; NaN for no vector.
Optional: validity (see `Validity`) or mask (true = masked out), sigma_u, sigma_v, c, p; and as text
length_unit, time_unit, velocity_unit; and y_down.

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

from granpinn.arrays import Int8, plain_array
from granpinn.importers.columns import Column, chosen, units_of
from granpinn.importers.limits import read_file, require_room
from granpinn.importers.vectors import (
    GAPS,
    DataFileError,
    Validity,
    VectorFields,
    split_gaps,
    vector_fields,
)

REQUIRED = ("t", "y", "x", "u", "v")
OPTIONAL = ("sigma_u", "sigma_v", "c", "p")
ARRAYS = (*REQUIRED, *OPTIONAL, "validity", "mask", "y_down")
TEXTS = ("length_unit", "time_unit", "velocity_unit")
INTERPOLATED_FROM = 5
_UNITLESS = ("chc", "p")  # a code, and a pressure that is kept for scoring only
VARIABLES = ("x", "y", "t", "u", "v", "chc", "sigma_u", "sigma_v", "c", "p")
DATASET = "the data set"


def sniff(path: Path, head: bytes) -> bool:
    """A zip archive named .npz."""
    return head.startswith(b"PK") and path.suffix.lower() == ".npz"


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
    found = {n: _numbers(arrays, n, path) for n in (*REQUIRED, *OPTIONAL) if n in arrays}
    require_room(sum(a.size for a in found.values()), 8, path)
    values = {name: a.astype(np.float64, copy=False) for name, a in found.items()}
    u, v = values["u"], values["v"]
    if u.shape != v.shape or u.ndim not in (1, 3):
        raise DataFileError(
            f"{path}: u and v must be [T, Y, X], or [n] for scattered vectors, got "
            f"{list(u.shape)} and {list(v.shape)}"
        )
    return vector_fields(
        **values,
        validity=_codes(arrays, np.isfinite(u) & np.isfinite(v), path),
        **{name: str(_one(arrays[name], name, path)) for name in TEXTS if name in arrays},
        y_down=bool(_one(_numbers(arrays, "y_down", path, "fiub"), "y_down", path))
        if "y_down" in arrays
        else None,
        facts={} if {"validity", "mask", "c"} & arrays.keys() else {"mask": GAPS},
    )


def _numbers(arrays: Mapping[str, Any], name: str, path: str, kinds: str = "fiu") -> Any:
    return plain_array(arrays[name], f"{path}: {name}", DataFileError, kinds=kinds)


def _one(given: Any, name: str, path: str) -> Any:
    """The single value of an array or a plain value."""
    found = np.asarray(given)
    if found.size != 1:
        raise DataFileError(f"{path}: {name} must be one value, got {found.size}: correct it")
    return found.flat[0]


def _codes(arrays: Mapping[str, Any], finite: Any, path: str) -> Any:
    codes = np.where(finite, Validity.VALID, Validity.INVALID)
    if "validity" in arrays:
        codes = _numbers(arrays, "validity", path)
        if not np.isin(codes, list(Validity)).all():
            raise DataFileError(f"{path}: validity must be 0, 1, 2 or 3, got another number")
    if "mask" in arrays:
        masked = _numbers(arrays, "mask", path, "fiub").astype(bool)  # NaN, no value, is masked
        if not masked.shape == codes.shape == finite.shape:
            raise DataFileError(
                f"{path}: mask must have the shape {list(finite.shape)} of u, got "
                f"{list(masked.shape)}"
            )
        return np.where(masked, Validity.MASKED, codes)
    known = {"validity", "c"} & arrays.keys() or finite.ndim == 1
    return codes if known else split_gaps(finite)


def from_dataset(data: Any) -> VectorFields:
    """Vector fields of an xarray.Dataset, with the numbers that its attributes mean.

    Raises:
        DataFileError: a variable is missing, or its dimensions or attributes are wrong.
    """
    import xarray

    names = [name for name in VARIABLES if name in data.variables]
    if missing := [name for name in ("x", "y", "u", "v") if name not in names]:
        raise DataFileError(
            f"{DATASET} must have the variables x, y, u, v, got no "
            f"{', '.join(missing)}: rename them"
        )
    require_room(sum(data[name].size for name in names), 8, DATASET)
    try:
        data = xarray.decode_cf(data, decode_times=False)
    except (ValueError, TypeError) as error:
        raise DataFileError(f"the attributes of {DATASET} contradict it: {error}") from None
    timed = any("t" in data[name].dims for name in names)
    columns, named = {}, []
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
        columns[name] = values.astype(np.float64).transpose([dims.index(dim) for dim in wanted])
        # pivpy writes "dt" for the time between the images of a pair.
        unit = str(variable.attrs.get("units", "")).replace("dt", "frame")
        named.append(Column(name, unit))
    _, stated = chosen(DATASET, named, {name: (name,) for name in columns if name not in _UNITLESS})
    units = units_of(DATASET, stated)
    chc = columns.pop("chc", None)
    if "t" not in columns:
        columns["t"] = np.arange(len(columns["u"]), dtype=np.float64)
        units["time_unit"] = "frame"
    elif units["time_unit"] is None and (columns["t"] == np.rint(columns["t"])).all():
        units["time_unit"] = "frame"
    return vector_fields(
        **columns,
        **units,
        validity=_chc_codes(chc, np.isfinite(columns["u"] + columns["v"]), "c" in columns),
        facts={} if "c" in columns else {"mask": GAPS},
    )


def _chc_codes(chc: Any, finite: Any, fraction: bool) -> Int8:
    """Validity of the vectors; their gaps show the mask where no `fraction` of grains does."""
    there = finite if chc is None else finite & (chc > 0)
    inside = np.where(there, np.int8(Validity.VALID), np.int8(Validity.INVALID))
    codes = inside if fraction else split_gaps(there)
    if chc is None:
        return codes
    codes[chc < 0] = Validity.INVALID
    codes[(chc >= INTERPOLATED_FROM) & finite] = Validity.INTERPOLATED
    return codes
