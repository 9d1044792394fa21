"""The rules for the shapes and types of a flow; they can run before the data is read."""

from __future__ import annotations

from collections.abc import Mapping

from granpinn.data.flow import FlowFileError
from granpinn.data.format import (
    GRID_DATASETS,
    PARTICLE_DATASETS,
    SURFACE_DATASETS,
    WALL_DATASETS,
    DatasetRule,
    Layout,
)

WRITE_HINT = "write it with granpinn.data.write_flow"


def check_layout(found: Mapping[str, Layout]) -> None:
    """Checks the presence, types and shapes of the datasets.

    Args:
        found: shape and type of every dataset of the format that the file has.
    """
    sizes: dict[str, int] = {}
    scattered = [rule.name for rule in PARTICLE_DATASETS if rule.name in found]
    gridded = [rule.name for rule in GRID_DATASETS if rule.name in found]
    if scattered and gridded:
        raise FlowFileError(
            f"a flow must be on a grid or at particles, got both {gridded[0]} and "
            f"{scattered[0]}: leave one of them out"
        )
    own = PARTICLE_DATASETS if scattered else GRID_DATASETS
    for rule in (*own, *SURFACE_DATASETS, *WALL_DATASETS):
        if rule.name in found:
            _check_one_layout(rule, found[rule.name], sizes)
        elif rule.required:
            names = ", ".join(found) or "none of the format"
            raise FlowFileError(
                f"{rule.name} is missing: expected a dataset {rule.name} {rule}, found {names}; "
                "add it" + ("" if scattered else ", NaN where nothing is known")
            )
    surface = [name for name in ("surface_t", "surface_x", "surface_y") if name in found]
    if len(surface) in (1, 2) or ("surface_p" in found and not surface):
        raise FlowFileError(
            "surface_t, surface_x and surface_y must come together, got "
            f"{' and '.join(surface) or 'surface_p'} alone: add the others or leave all out"
        )
    walls = [rule.name for rule in WALL_DATASETS if rule.name in found]
    for first, second in (("wall_x", "wall_y"), ("wall_u", "wall_v")):
        if (first in walls) != (second in walls) or (walls and "wall_x" not in walls):
            raise FlowFileError(
                f"{first} and {second} must come together, and with every other dataset of walls "
                f"wall_x and wall_y, got {' and '.join(walls)}: add the others or leave them out"
            )


def _check_one_layout(rule: DatasetRule, layout: Layout, sizes: dict[str, int]) -> None:
    """Checks one dataset against its rule; `sizes` collects the length of every axis."""
    name, shape = rule.name, layout.shape
    axes = f"[{', '.join(rule.axes)}]"
    if layout.dtype not in rule.dtypes:
        raise FlowFileError(
            f"{name} must be {rule}, got {layout.dtype} {list(shape)}: convert it or {WRITE_HINT}"
        )
    if len(shape) != len(rule.axes):
        raise FlowFileError(
            f"{name} must be {rule}, got {len(shape)} dimensions {list(shape)}: reshape it"
        )
    points = {"n": "surface", "m": "walls"}.get(rule.axes[0])
    if points and shape[0] == 0:
        raise FlowFileError(
            f"{name} must hold at least one point, got none: leave the {points} out instead"
        )
    least = 1 if rule.axes == ("T",) else 2  # one frame is a steady flow
    if len(shape) == 1 and not points and shape[0] < least:
        raise FlowFileError(
            f"{name} must hold at least {('one value', 'two values')[least - 1]}, got {shape[0]}: "
            "give more of the flow"
        )
    for axis, size in zip(rule.axes, shape, strict=True):
        sizes.setdefault(axis, size)
    expected = tuple(sizes[axis] for axis in rule.axes)
    if shape == expected:
        return
    if rule.axes == ("n",):
        raise FlowFileError(
            f"{name} must have as many points as surface_t, {expected[0]}, got {shape[0]}: "
            "give every surface point a time, a position and, if at all, a pressure"
        )
    if rule.axes == ("m",):
        raise FlowFileError(
            f"{name} must have as many points as wall_x, {expected[0]}, got {shape[0]}: give every "
            "point of a wall a value, NaN where two pieces part"
        )
    advice = (
        "transpose it"
        if sorted(shape) == sorted(expected)
        else "give it a value at every point of the grid t, y, x"
    )
    raise FlowFileError(f"{name} must be {axes} = {list(expected)}, got {list(shape)}: {advice}")
