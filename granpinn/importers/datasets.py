"""Data sets of xarray in the schema of pivpy: dimensions y, x, t; variables u, v, chc.

chc: 1 to 4 measured (number of the correlation peak), 5 and above interpolated, 0 nothing, below 0
rejected; some writers put 0 into u and v there. `units` is an attribute of every variable. This
package adds c (volume fraction), p, sigma_u, sigma_v.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granpinn.arrays import Int8, plain_array
from granpinn.importers.columns import Column, chosen, units_of
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.limits import require_room
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

INTERPOLATED_FROM = 5
_UNITLESS = ("chc", "p")  # a code, and a pressure that is kept for scoring only
VARIABLES = ("x", "y", "t", "u", "v", "chc", "sigma_u", "sigma_v", "c", "p")
NAME = "the data set"


def from_dataset(data: Any) -> VectorFields:
    """Vector fields of an xarray.Dataset, with the numbers that its attributes mean.

    Raises:
        DataFileError: a variable is missing, or its dimensions or attributes are wrong.
    """
    import xarray

    names = [name for name in VARIABLES if name in data.variables]
    if missing := [name for name in ("x", "y", "u", "v") if name not in names]:
        raise DataFileError(
            f"{NAME} must have the variables x, y, u, v, got no {', '.join(missing)}: rename them"
        )
    require_room(sum(data[name].size for name in names), 8, NAME)
    try:
        data = xarray.decode_cf(data, decode_times=False)
    except (ValueError, TypeError) as error:
        raise DataFileError(f"the attributes of {NAME} contradict it: {error}") from None
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
                f"{NAME}: {name} must have the dimensions {', '.join(wanted)}, got "
                f"{', '.join(map(str, dims))}: reduce or rename them"
            )
        columns[name] = values.astype(np.float64).transpose([dims.index(dim) for dim in wanted])
        # pivpy writes "dt" for the time between the images of a pair.
        unit = str(variable.attrs.get("units", "")).replace("dt", "frame")
        named.append(Column(name, unit))
    _, stated = chosen(NAME, named, {name: (name,) for name in columns if name not in _UNITLESS})
    units = units_of(NAME, stated)
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
        facts={} if "c" in columns else {"mask": GAPS},
    )


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
