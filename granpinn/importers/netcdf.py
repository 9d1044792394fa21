"""netCDF in the schema of pivpy: dimensions y, x, t; variables u, v, chc.

chc: 1 to 4 measured (number of the correlation peak), 5 and above interpolated, 0 nothing, below 0
rejected; some writers put 0 into u and v there. Attributes: `units` of every variable, `delta_t`.
This package adds c (volume fraction), p, sigma_u, sigma_v.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Int8
from granpinn.errors import BadInput
from granpinn.importers.columns import Column, chosen, in_one_unit
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.limits import read_file, require_room
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields
from granpinn.regular import UnsafeFileError

INTERPOLATED_FROM = 5
_UNITLESS = ("chc", "p")  # a code, and a pressure that is kept for scoring only
_EXTRAS = ("sigma_u", "sigma_v", "c", "p")
VARIABLES = ("x", "y", "t", "u", "v", "chc", *_EXTRAS)


def sniff(path: Path, head: bytes) -> bool:
    """netCDF-3, or a HDF5 file named .nc or .netcdf."""
    hdf5 = head.startswith(b"\x89HDF") and path.suffix.lower() in (".nc", ".nc4", ".netcdf", ".cdf")
    return hdf5 or head.startswith(b"CDF")


def read(path: Path) -> VectorFields:
    """All frames of a data set."""
    found = read_file("datasets", path, names=VARIABLES)
    return _fields(str(path), found["variables"], found["delta_t"])


def from_dataset(data: Any) -> VectorFields:
    """Vector fields of an xarray.Dataset."""
    from granpinn.foreign.datasets import variables_of

    path = "the data set"
    require_room(sum(data[n].size for n in VARIABLES if n in data.variables), 8, path)
    try:
        variables = variables_of(data, VARIABLES)
    except (UnsafeFileError, BadInput) as error:
        raise DataFileError(f"{path}: {error}") from None
    return _fields(path, variables, str(data.attrs.get("delta_t", "")))


def _fields(path: str, variables: dict[str, Any], delta_t: str) -> VectorFields:
    """Vector fields of variables as `granpinn.foreign.datasets.variables_of` gives them."""
    missing = [name for name in ("x", "y", "u", "v") if name not in variables]
    if missing:
        raise DataFileError(
            f"{path} must have the variables x, y, u, v, got no {', '.join(missing)}: rename them"
        )
    timed = any("t" in variable["dims"] for variable in variables.values())
    columns = {}
    for name, variable in variables.items():
        wanted = (name,) if name in "xyt" else ("t", "y", "x")
        values, dims = variable["values"], variable["dims"]
        if not timed and "t" in wanted:
            values, dims = values[None], ["t", *dims]
        if sorted(dims) != sorted(wanted):
            raise DataFileError(
                f"{path}: {name} must have the dimensions {', '.join(wanted)}, got "
                f"{', '.join(dims)}: reduce or rename them"
            )
        columns[name] = values.transpose([dims.index(dim) for dim in wanted])
    named = [Column(name, _unit(variables[name]["unit"])) for name in columns]
    _, stated = chosen(path, named, {name: (name,) for name in columns if name not in _UNITLESS})
    columns, units, differing = in_one_unit(path, columns, stated)
    chc = columns.pop("chc", None)
    if "t" not in columns:
        columns["t"] = np.arange(len(columns["u"]), dtype=np.float64)
        units["time_unit"] = "frame"
    elif units["time_unit"] is None and (columns["t"] == np.rint(columns["t"])).all():
        units["time_unit"] = "frame"
    return vector_fields(
        **columns,
        **units,
        validity=_codes(chc, np.isfinite(columns["u"] + columns["v"]), "c" in columns),
        facts={"delta_t": delta_t} | ({} if "c" in columns else {"mask": GAPS}) | differing,
    )


def _unit(stated: str) -> str:
    # pivpy writes "dt" for the time between the images of a pair.
    return stated.replace("dt", "frame")


def _codes(chc: Any, finite: Any, fraction: bool) -> Int8:
    """Validity of the vectors; their gaps show the mask where no `fraction` of grains does."""
    there = finite if chc is None else finite & (chc > 0)
    inside = np.where(there, np.int8(Validity.VALID), np.int8(Validity.INVALID))
    codes = inside if fraction else split_gaps(there)
    if chc is None:
        return codes
    codes[chc < 0] = Validity.INVALID
    codes[(chc >= INTERPOLATED_FROM) & finite] = Validity.INTERPOLATED
    return codes
