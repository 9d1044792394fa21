"""Fields and members as xarray data sets, for notebooks."""

from __future__ import annotations

from typing import Any

import numpy as np

from granpinn.results.fields import VARIABLES, Fields
from granpinn.results.result import Result


def fields_dataset(fields: Fields) -> Any:
    """The fields as an xarray.Dataset over (t, y, x): NaN outside the grains, units in `attrs`."""
    import xarray  # slow to import

    units = fields.units
    axes = {
        name: (name, getattr(fields, name), _attributes(units.of(kind), long_name))
        for name, kind, long_name in (
            ("t", "time", "time"),
            ("y", "length", "upward position"),
            ("x", "length", "position to the right"),
        )
    }
    described = {"c": (fields.c, "number", "volume fraction of grains")}
    for name, (kind, long_name) in VARIABLES.items():
        if name in fields.values:
            described[name] = (fields.grid(name), kind, long_name)
    variables = {
        name: (("t", "y", "x"), values, _attributes(units.of(kind), long_name))
        for name, (values, kind, long_name) in described.items()
    }
    scales = {f"{name}_scale": getattr(fields, name) for name in ("length", "time", "pressure")}
    return xarray.Dataset(variables, axes, scales)


def members_tree(result: Result) -> Any:
    """The values of an ensemble as an xarray.DataTree with the group `posterior`.

    Each free parameter has the dimensions (chain, draw): one chain, one draw for each network. The
    scatter of networks is one part of the error bars and no posterior of the data.

    Raises:
        ValueError: the result has no members.
    """
    import xarray

    if result.members is None:
        raise ValueError("this result states no members: identify with Config(members=8)")
    found = {
        name: (("chain", "draw"), np.array([values]), {"long_name": f"parameter {name}"})
        for name, values in result.members.values.items()
    }
    count = len(result.members.seed)
    # Seeds reach 2^63, which not every integer type of a plotting package holds.
    axes = {"chain": [0], "draw": np.arange(count), "seed": ("draw", np.array(result.members.seed))}
    about = {"note": "networks with different seeds; their scatter is no posterior of the data"}
    posterior = xarray.Dataset(found, axes, about)
    return xarray.DataTree.from_dict({"posterior": posterior})


def _attributes(unit: str | None, long_name: str) -> dict[str, str]:
    return {"long_name": long_name} | ({} if unit is None else {"units": unit})
