"""The rules for the attributes of a flow: material, units, and whatever else the file states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granpinn.data.flow import (
    LARGEST,
    LEAST,
    PERIOD_X,
    SOLVER_CELL,
    SOLVER_MEAN,
    STEADY,
    SURFACE_SD,
    WALL_GAP,
    WINDOW,
    Flow,
    FlowFileError,
    Truth,
)
from granpinn.data.schema import TRUTH

LONGEST_UNIT = 64  # characters
# Attributes without a meaning for the training, which second opinions take as sizes.
STATED = frozenset(
    (
        *("box_width", "box_height", "domain_size", "column_width", "column_height"),
        *(SOLVER_CELL, SOLVER_MEAN, "air_density", "air_viscosity", "cohesion"),
    )
)
# Lengths that a file may state: words for 0 where it may be 0, and when to leave them out.
LENGTHS = {
    WALL_GAP: ("", " if no side walls touch the grains"),
    SURFACE_SD: ("0 for an exact line or ", ""),
    PERIOD_X: ("", " if the sides are not periodic"),
    WINDOW: ("", " if each vector is a value at a point"),
}


def check_constants(**constants: Any) -> None:
    """Checks the fields of a Flow that are no arrays, before there are any arrays.

    Raises:
        FlowFileError: one breaks a rule.
    """
    nothing = np.empty(0)
    arrays: dict[str, Any] = dict.fromkeys(("t", "y", "x", "u", "v", "c"), nothing)
    check_constants_of(Flow(**arrays, **constants))


def check_constants_of(flow: Flow) -> None:
    """Raises FlowFileError if a number or text of a flow breaks a rule; its arrays do not count."""
    _check_attributes(flow)
    _check_units(flow)
    _check_material_constants(flow)


def _check_units(flow: Flow) -> None:
    for name in ("length_unit", "time_unit", "density_unit"):
        unit = getattr(flow, name)
        if unit is not None and not (
            isinstance(unit, str) and unit.isprintable() and 0 < len(unit) <= LONGEST_UNIT
        ):
            raise FlowFileError(
                f"{name} must be the name of a unit, 1 to {LONGEST_UNIT} printable characters, "
                f"got {str(unit)[:LONGEST_UNIT]!r} of {len(str(unit))}: write '1' for a "
                "dimensionless flow"
            )
        if unit is not None and "since" in unit:
            raise FlowFileError(
                f"{name} must be the name of a unit, got {unit!r}, which other programs take for a "
                "date: name the unit alone; the origin of the time is free"
            )


def _check_attributes(flow: Flow) -> None:
    for name, value in flow.attributes.items():
        if not name.isidentifier() or not isinstance(value, str | int | float | np.number):
            raise FlowFileError(
                f"the attribute {name!r} must be one number or text under a plain name, got "
                f"{type(value).__name__}: change it or leave it out"
            )
        known = isinstance(value, str) or value == 0 or LEAST <= value <= LARGEST
        if name in STATED and not known:
            raise FlowFileError(
                f"the attribute {name!r} must be 0 or from {LEAST:g} to {LARGEST:g}, got "
                f"{value:g}: correct it or leave it out"
            )
    steady = flow.attributes.get(STEADY, 0)
    if steady not in (0, 1):
        raise FlowFileError(
            f"the attribute {STEADY} must be 1 in a steady flow and 0 in any other, got "
            f"{steady!r}: correct it or leave it out"
        )
    for name, (zero, without) in LENGTHS.items():
        value = flow.attributes.get(name, 1.0)
        if isinstance(value, str) or not ((zero and value == 0) or LEAST <= value <= LARGEST):
            raise FlowFileError(
                f"the attribute {name} must be {zero}a length from {LEAST:g} to {LARGEST:g}, got "
                f"{value!r}: correct it, or leave it out{without}"
            )


def _check_material_constants(flow: Flow) -> None:
    truth = flow.truth or Truth()
    positive = {
        "density": flow.density,
        "grain_diameter": flow.grain_diameter,
        "grain_density": flow.grain_density,
        "eta_max": flow.eta_max,
        **{name: getattr(truth, field) for name, field in TRUTH.items()},
    }
    for name, value in positive.items():
        if value is not None and not LEAST <= value <= LARGEST:
            raise FlowFileError(
                f"{name} must be a positive number, got {value:g}: correct this attribute, "
                f"{LEAST:g} to {LARGEST:g} is possible"
            )
    if flow.grain_density is not None and flow.grain_density < flow.density:
        raise FlowFileError(
            f"grain_density must be at least density, the bulk density {flow.density:g}, got "
            f"{flow.grain_density:g}: density is grain_density times the solid fraction"
        )
    if flow.eta_min is not None and not 0 <= flow.eta_min < (flow.eta_max or math.inf):
        raise FlowFileError(
            f"eta_min must be at least 0 and below eta_max, got {flow.eta_min:g}: correct this "
            "attribute or leave it out"
        )
    gravity = flow.gravity
    size = max(map(abs, gravity), default=0.0)
    if len(gravity) != 2 or not all(map(math.isfinite, gravity)) or not LEAST <= size <= LARGEST:
        raise FlowFileError(
            f"gravity must be two finite numbers (g_x, g_y), not both 0, got "
            f"{[float(g) for g in gravity]}: correct this attribute"
        )
