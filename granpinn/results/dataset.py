"""Fields as an xarray data set, for notebooks."""

from __future__ import annotations

from typing import Any

from granpinn.results.fields import VARIABLES, Fields


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


def _attributes(unit: str | None, long_name: str) -> dict[str, str]:
    return {"long_name": long_name} | ({} if unit is None else {"units": unit})
