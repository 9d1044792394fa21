"""The rules for the walls of a flow, each with one error that names the dataset and the remedy."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data.flow import Flow, FlowFileError, Walls
from granpinn.data.walls import segments_of

# Farthest point of a wall from the grid, in units of the grid's extent: a wall may be much longer
# than the picture, but one in other units is far away.
MARGIN = 10.0
MOST_POINTS = 100_000


def check_walls(flow: Flow, walls: Walls) -> None:
    """Checks the numbers of walls that have passed `check_layout`.

    Raises:
        FlowFileError: they break a rule.
    """
    m = walls.x.size
    if m > MOST_POINTS:
        raise FlowFileError(
            f"wall_x must hold at most {MOST_POINTS} points, got {m}: a straight wall needs its "
            "two ends only"
        )
    parts = np.isnan(walls.x)
    if not np.array_equal(parts, np.isnan(walls.y)):
        raise FlowFileError(
            "wall_x and wall_y must be NaN at the same points, where two pieces of wall part, got "
            f"NaN in one of them alone at index {int(np.argmax(parts != np.isnan(walls.y)))}: "
            "set both to NaN or neither"
        )
    _check_pieces(parts, np.stack([walls.x, walls.y], 1))
    for name in ("x", "y"):
        _check_places(name, getattr(walls, name)[~parts], getattr(flow, name))
    _check_values(walls, parts)
    _check_times(flow, walls, parts)
    _check_length(flow, walls)


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


def _check_length(flow: Flow, walls: Walls) -> None:
    """Every spacing of a wall becomes a point of the training, in every frame."""
    segments = segments_of(walls)
    stays = np.isnan(segments.t)
    _, number = np.unique(segments.t[~stays], return_inverse=True)
    moving = np.bincount(number, segments.length[~stays], minlength=1)
    longest = float(segments.length[stays].sum() + moving.max())
    spacing = max(flow.spacing)
    if longest > MOST_POINTS * spacing:
        raise FlowFileError(
            f"wall_x and wall_y must be lines of at most {MOST_POINTS} times the grid spacing "
            f"{spacing:g} at any one time, all together, got {longest:g}: leave out what no grains "
            "touch, and lines that go to and fro"
        )


def _check_places(name: str, values: Float64, axis: Float64) -> None:
    low, high = float(axis[0]), float(axis[-1])
    with np.errstate(over="ignore"):
        margin = MARGIN * (high - low)
    if not (values.min() >= low - margin and values.max() <= high + margin):
        raise FlowFileError(
            f"wall_{name} must lie within {name}, {low:g} to {high:g}, or not more than "
            f"{MARGIN:g} times its extent outside, got {values.min():g} to {values.max():g}: "
            "check its unit, or cut the wall where no grains touch it"
        )


def _check_values(walls: Walls, parts: Bool) -> None:
    for name in ("u", "v", "slip"):
        values = getattr(walls, name)
        if values is not None and not np.isfinite(values[~parts]).all():
            raise FlowFileError(
                f"wall_{name} must be finite at every point of a wall, got NaN or infinity at "
                f"index {int(np.argmax(~parts & ~np.isfinite(values)))}: give a value there"
            )
    slip = walls.slip
    if slip is not None and not np.isin(slip[~parts], (0.0, 1.0)).all():
        wrong = slip[~parts][~np.isin(slip[~parts], (0.0, 1.0))][0]
        raise FlowFileError(
            "wall_slip must be 0 where grains move with the wall and 1 where they may slip along "
            f"it, got {wrong:g}: correct it"
        )
    for name in ("p", "tau"):
        stress = getattr(walls, name)
        if stress is None:
            continue
        stress = stress[~parts]
        if not (np.isnan(stress) | (np.isfinite(stress) & (stress >= 0))).all():
            raise FlowFileError(
                f"wall_{name} must be a stress of at least 0, or NaN where it is not known, got "
                f"{float(np.nanmin(stress)):g} to {float(np.nanmax(stress)):g}: grains do not pull "
                "on a wall, and of a shear stress give the size"
            )


def _check_times(flow: Flow, walls: Walls, parts: Bool) -> None:
    """A piece has one time, or none; times lie within those of the flow."""
    if walls.t is None:
        return
    t = walls.t
    inside = ~parts[1:] & ~parts[:-1]
    same = (t[1:] == t[:-1]) | (np.isnan(t[1:]) & np.isnan(t[:-1]))
    if (inside & ~same).any():
        k = int(np.argmax(inside & ~same))
        raise FlowFileError(
            f"wall_t must be the same at all points of a piece, got {t[k]:g} then {t[k + 1]:g} at "
            f"index {k}: put NaN into wall_x and wall_y between pieces of different times"
        )
    known = t[~parts & ~np.isnan(t)]
    if flow.steady or known.size == 0:
        return
    low, high = float(flow.t[0]), float(flow.t[-1])
    with np.errstate(over="ignore"):
        margin = high - low
    if not (known.min() >= low - margin and known.max() <= high + margin):
        raise FlowFileError(
            f"wall_t must lie near t, {low:g} to {high:g}, got {known.min():g} to "
            f"{known.max():g}: check its unit, or leave wall_t out for walls that stay"
        )
