"""The rules for the numbers of a flow, each with one error that names the dataset and the remedy.

The tables of `schema.py` have the shape, the type and the range of every dataset and attribute.
Here is what must fit together.
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Bool, Float64, Floats
from granpinn.data.flow import (
    LARGEST,
    LEAST,
    PERIOD_X,
    STEADY,
    SURFACE_SD,
    Flow,
    FlowFileError,
    Surface,
    Walls,
)
from granpinn.data.large import slabs
from granpinn.data.scaling import FLOAT32, RESOLUTION, initial_height, scales_of
from granpinn.data.schema import (
    ATTRIBUTES,
    arrays_in,
    arrays_of,
    attributes_of,
    check_layout,
    check_pairs,
    check_range,
    check_ranges,
)
from granpinn.data.walls import segments_of
from granpinn.declared import checked

LONGEST_UNIT = 64  # characters
# Largest rounding of a coordinate, in units of its smallest step.
LARGEST_ROUNDING = 0.01
# Largest distance of surface points from the cell centers: part of their extent, or cells.
SURFACE_MARGIN, SURFACE_CELLS = 0.1, 1.0
# Farthest point of a wall from the grid, in units of the grid's extent: a wall may be much longer
# than the picture, but one in other units is far away.
WALL_MARGIN = 10.0
MOST_WALL_POINTS = 100_000


@checked
def check_flow(flow: Flow) -> None:
    """Raises FlowFileError if the flow breaks a rule of the format."""
    for arrays in (arrays_of(flow), arrays_in(flow)):
        check_layout(arrays)
    check_constants(flow)
    arrays = arrays_of(flow) | arrays_in(flow)
    check_pairs({**arrays, **{n: a for n, a in attributes_of(flow).items() if a is not None}})
    check_ranges({name: a for name, a in arrays.items() if a.ndim == 1})
    for frames in slabs(flow):
        check_ranges({name: a[frames] for name, a in arrays.items() if a.ndim == 3})
    for name, values in (("t", flow.t), ("y", flow.y), ("x", flow.x)):
        _check_order(name, values)
    _check_symmetries(flow)
    _check_grains(flow)
    _check_precision(flow)
    _check_velocity(flow)
    _check_known(flow)
    if flow.surface is not None:
        _check_surface(flow, flow.surface)
    if flow.walls is not None:
        _check_walls(flow, flow.walls)


def check_constants(flow: Flow) -> None:
    """Raises FlowFileError if a number or a text breaks a rule; the arrays may be empty."""
    for name, value in flow.attributes.items():
        if not name.isidentifier() or not isinstance(value, str | int | float | np.number):
            raise FlowFileError(
                f"the attribute {name!r} must be one number or text under a plain name, got "
                f"{type(value).__name__}: change it or leave it out"
            )
    if flow.attributes.get(STEADY, 0) not in (0, 1):
        raise FlowFileError(
            f"{STEADY} must be 1 in a steady flow and 0 in any other, got "
            f"{flow.attributes[STEADY]!r}: correct it or leave it out"
        )
    stated = attributes_of(flow)
    for name, rule in ATTRIBUTES.items():
        value = stated.get(name)
        if value is None or isinstance(value, np.ndarray):
            continue
        if isinstance(value, str) and rule.kind is float:
            raise FlowFileError(
                f"{name} must be a number, got {value!r}: correct it or leave it out"
            )
        if rule.kind is float:
            check_range(name, value, rule.low, rule.high)
        elif not (value.isprintable() and 0 < len(value) <= LONGEST_UNIT and "since" not in value):
            raise FlowFileError(
                f"{name} must be the name of a unit, 1 to {LONGEST_UNIT} printable characters and "
                f"no date, got {value[:LONGEST_UNIT]!r} of {len(value)}: write '1' for a "
                "dimensionless flow"
            )
    if flow.grain_density is not None and flow.grain_density < flow.density:
        raise FlowFileError(
            f"grain_density must be at least density, the bulk density {flow.density:g}, got "
            f"{flow.grain_density:g}: density is grain_density times the solid fraction"
        )
    if flow.eta_min is not None and flow.eta_min >= (flow.eta_max or math.inf):
        raise FlowFileError(
            f"eta_min must be below eta_max, {flow.eta_max:g}, got {flow.eta_min:g}: correct this "
            "attribute or leave it out"
        )
    gravity = flow.gravity
    size = max(map(abs, gravity))
    finite = all(map(math.isfinite, gravity))
    if not (finite and LEAST <= size <= LARGEST and gravity[1] < 0):
        raise FlowFileError(
            "gravity must be two finite numbers (g_x, g_y), g_y < 0 as y points up, got "
            f"{[float(g) for g in gravity]}: correct it, or turn the data by quarters (numpy.rot90)"
        )


def _check_order(name: str, values: Float64) -> None:
    """A coordinate increases."""
    steps = np.diff(values)
    if not (steps > 0).all():
        i = int(np.argmin(steps > 0))
        raise FlowFileError(
            f"{name} must increase strictly, got {values[i]:g} then {values[i + 1]:g} at index "
            f"{i}: sort the data along {name}"
        )


def _check_precision(flow: Flow) -> None:
    """The steps of a coordinate exceed its rounding in float64, and in a training."""
    scales = scales_of(flow)
    units = {"t": scales.time, "y": scales.length, "x": scales.length}
    for name, unit in units.items():
        values = getattr(flow, name)
        steps = np.diff(values)
        rounding = max(
            float(np.spacing(np.abs(values).max())) / LARGEST_ROUNDING,
            2 * FLOAT32 * float(np.ptp(values)),
            RESOLUTION * unit,
        )
        if rounding > steps.min(initial=np.inf):
            raise FlowFileError(
                f"{name} must have steps of at least {rounding:g}, as numbers of its size are "
                f"rounded, got {steps.min():g} after {values[int(np.argmin(steps))]:g}: subtract "
                "the first value before the file is written, correct the unit, or leave out values "
                "that are too close"
            )


def _check_symmetries(flow: Flow) -> None:
    """What the file states about the whole flow must fit its grid."""
    if flow.t.size == 1 and flow.attributes.get(STEADY, 1) == 0:
        raise FlowFileError(
            f"a flow of one frame must be steady, got the attribute {STEADY} = 0: give more "
            "frames, or leave the attribute out"
        )
    period, width = flow.stated(PERIOD_X), float(flow.x[-1] - flow.x[0])
    if period is not None and not period > width:
        raise FlowFileError(
            f"the attribute {PERIOD_X} must be longer than x, which spans {width:g}, got "
            f"{period:g}: give the length of the period in the unit of x, and each place once"
        )


def _check_grains(flow: Flow) -> None:
    """There are grains in the first frame, higher than one grain."""
    height = initial_height(flow)
    sizes = {"grain_diameter": flow.grain_diameter}
    sizes |= {f"the attribute {SURFACE_SD}": flow.stated(SURFACE_SD) or 0.0}
    for name, size in sizes.items():
        if size > height:
            raise FlowFileError(
                f"{name} must be smaller than the height of the grains in the first frame, "
                f"{height:g}, got {size:g}: give both in the unit of length of the file"
            )


def _in_any_cell(mask: Bool) -> Bool:
    """Whether `mask` [T, Y, X] is true anywhere in each frame: [T]."""
    return np.asarray(mask.any(axis=(1, 2)))


def _check_gaps(a: Floats, b: Floats, names: str) -> None:
    """Two components have their gaps in common."""
    if count := int((np.isnan(a) != np.isnan(b)).sum()):
        raise FlowFileError(
            f"{names} must be NaN at the same points, got {count} where only one of them is: set "
            "both to NaN"
        )


def _check_velocity(flow: Flow) -> None:
    """Vectors have both components, and are there in every frame."""
    parts = slabs(flow)
    for k in parts:
        _check_gaps(flow.u[k], flow.v[k], "u and v")
    empty = np.concatenate([_without_vectors(flow, k) for k in parts])
    if empty.any():
        first = int(np.argmax(empty))
        raise FlowFileError(
            f"u and v must hold valid vectors among the grains in every frame, got only NaN in "
            f"{int(empty.sum())} of {len(empty)} frames (first: t = {flow.t[first]:g}): "
            "leave these frames out"
        )


def _without_vectors(flow: Flow, frames: slice) -> Bool:
    """Frames [K] without any vector, or without one among their grains."""
    empty = ~_in_any_cell(~np.isnan(flow.u[frames]))
    return empty | (_in_any_cell(flow.c[frames] >= 1) & ~_in_any_cell(flow.valid_in(frames)))


def _check_known(flow: Flow) -> None:
    """Grains have a pressure, and valid vectors standard deviations, if the flow has any."""
    for name in ("p", "sigma_u", "sigma_v"):
        values, low = getattr(flow, name), -LARGEST if name == "p" else LEAST
        for k in slabs(flow) if isinstance(values, np.ndarray) else ():
            where = flow.c[k] >= 1 if name == "p" else flow.valid_in(k)
            remedy = "give it everywhere in the grains, or leave it out"
            check_range(name, np.where(where, values[k], 1.0), low, LARGEST, remedy=remedy)


def _check_surface(flow: Flow, surface: Surface) -> None:
    """The line lies within the grid."""
    for name in ("t", "x", "y"):
        values, grid = getattr(surface, name), getattr(flow, name)
        if name == "t" and flow.steady:
            continue
        cell = float(np.median(np.diff(grid)))
        margin = max(SURFACE_MARGIN * (grid[-1] - grid[0]), SURFACE_CELLS * cell)
        _check_within(f"surface_{name}", values, name, grid, margin)


def _check_within(what: str, values: Float64, name: str, grid: Float64, margin: float) -> None:
    """Values lie between the ends of a coordinate, or beyond by a margin."""
    low, high = float(grid[0]), float(grid[-1])
    if values.min() < low - margin or values.max() > high + margin:
        raise FlowFileError(
            f"{what} must lie within {name}, {low:g} to {high:g}, or at most {margin:g} beyond, "
            f"got {values.min():g} to {values.max():g}: check its unit or leave out the rest"
        )


def _check_walls(flow: Flow, walls: Walls) -> None:
    parts = np.isnan(walls.x)
    _check_gaps(walls.x, walls.y, "wall_x and wall_y")
    _check_pieces(parts, np.stack([walls.x, walls.y], 1))
    for name in ("x", "y"):
        grid = getattr(flow, name)
        margin = WALL_MARGIN * float(grid[-1] - grid[0])
        _check_within(f"wall_{name}", getattr(walls, name)[~parts], name, grid, margin)
    slip = walls.slip
    if slip is not None and not np.isin(slip[~parts], (0.0, 1.0)).all():
        wrong = slip[~parts][~np.isin(slip[~parts], (0.0, 1.0))][0]
        raise FlowFileError(
            "wall_slip must be 0 where grains move with the wall and 1 where they may slip along "
            f"it, got {wrong:g}: correct it"
        )
    _check_size(flow, walls)


def _check_pieces(parts: Bool, place: Float64) -> None:
    """Every piece needs two points [m, 2] that differ."""
    piece, moves = np.cumsum(parts), (place[1:] != place[:-1]).any(axis=1)
    moves &= ~parts[1:] & ~parts[:-1]
    bare = np.flatnonzero(~parts & ~np.isin(piece, piece[1:][moves]))
    if bare.size or parts.all():
        raise FlowFileError(
            "every piece of a wall must have at least two points that differ, got none in that at "
            f"index {bare[0] if bare.size else 0} of wall_x: give both ends of the wall, and NaN "
            "between two pieces only"
        )


def _check_size(flow: Flow, walls: Walls) -> None:
    """Every spacing of a wall becomes a point of the training, in every frame."""
    size = max(walls.x.size, float(segments_of(walls).length.sum()) / max(flow.spacing))
    if size > MOST_WALL_POINTS:
        raise FlowFileError(
            f"walls must have at most {MOST_WALL_POINTS} points, and as many spacings of the grid "
            f"along them, got {size:.4g}: give the two ends of a straight wall, and leave out "
            "what no grains touch, and lines that go to and fro"
        )
