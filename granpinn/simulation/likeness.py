"""The scene of the simulator that is like a measured flow, with a given law.

The simulator starts from the grains of the first frame, with the gravity, density and grain
diameter of the flow file. It can start only from rest, from a column in the lower left corner of a
box. Its grains touch a floor at y = 0 and walls at x = 0 and at the width of the box, all at rest.
Other flows have the reason instead. An even layer on a slope needs no simulation: the momentum
balance gives its pressure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.data.flow import SOLVER_CELL, WALL_GAP
from granpinn.data.walls import segments_of
from granpinn.physics.laws import FrictionLaw
from granpinn.simulation.parameters import FEWEST_CELLS, Collapse
from granpinn.simulation.scene import CELLS_MULTIPLE, law_settings

NEAR = 0.5  # spacings between a wall of the file and one of the simulator
LEAST_FILLED = 0.95  # share of the rectangle around the first frame's grains
LATEST_START = 0.1  # of the time in which the grains flow: latest time of the first frame
AT_REST = 0.02  # of sqrt(|g| H)
MORE_THAN_FREE_FALL = 1.5
# The largest simulations that a flow file may ask for: wrong units must not take days.
MOST_CELLS = 512  # across the box, unless the settings have a number
LARGEST_AREA = 3  # largest number of cells of a box, in squares of so many across
MOST_STEPS = 100_000  # of the largest length; the paper's collapse has 500
PERIODIC = "the sides are periodic, and the simulator has walls there"
STEADY = "the flow is steady, and the simulator has only grains that start from rest"
CORNER = "do not stand in the corner of wall and floor, which the simulator has at x = 0 and y = 0"


class GrainColumn(NamedTuple):
    """Grains as a column in the corner, in the units of the file."""

    width: float
    height: float


class Nodes(NamedTuple):
    """Coordinates of a grid, [Y] and [X]."""

    y: Float64
    x: Float64


def scene_of(
    flow: Flow,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None = None,
    wall_friction: float | None = None,
) -> tuple[Collapse, GrainColumn] | str:
    """The scene of a flow and its column, or why there is none.

    Args:
        flow: as `symmetry.with_layer` gives it.
        theta, cells, wall_friction: as in `collapse_of`.
    """
    column = initial_column(flow)
    if isinstance(column, str):
        return column
    try:
        scene = collapse_of(flow, column, law, theta, cells, wall_friction)
        assert scene.t_end is not None
        steps = scene.t_end / scene.largest_step
        if not steps <= MOST_STEPS:
            raise ConfigError(
                f"the last time in the file, {scene.t_end:g}, would take at least {steps:.3g} "
                f"steps of the simulator, at most {MOST_STEPS} are allowed: check the units of "
                "time and gravity"
            )
    except ConfigError as error:
        return str(error)
    return scene, column


def unlike(flow: Flow) -> str | None:
    """Why the simulator cannot have a flow, whatever its grains; None if it may."""
    if flow.periodic:
        return PERIODIC
    return STEADY if flow.steady else foreign_wall(flow)


def initial_column(flow: Flow) -> GrainColumn | str:
    """The column at the start of a flow, or the reason why there is none."""
    if objection := unlike(flow):
        return objection
    full = flow.c[0] >= 0.5
    if not full.any():
        return "the first frame holds no grains"
    if not in_corner(flow, 0):
        return f"the grains of the first frame {CORNER}"
    measured = extent(flow, full)
    filled = float(full[np.ix_(flow.y < measured.height, flow.x < measured.width)].mean())
    if filled < LEAST_FILLED:
        return (
            f"the first frame is not a column: its grains fill {100 * filled:.0f} % of the "
            f"rectangle around them, at least {100 * LEAST_FILLED:.0f} % are expected"
        )
    if objection := not_from_rest(flow, measured.height):
        return objection
    lengths = []
    # A length in the file holds if it agrees with the first frame.
    for name, length, spacing in zip(GrainColumn._fields, measured, flow.spacing, strict=True):
        stated = flow.stated(f"column_{name}")
        agrees = stated is not None and abs(stated - length) <= spacing
        lengths.append(stated if stated is not None and agrees else length)
    return GrainColumn(*lengths)


def not_from_rest(flow: Flow, height: float) -> str | None:
    """Why the first frame does not follow a release at t = 0 of grains of some height, or None.

    The first frame is in a tenth of the time in which such grains flow.
    """
    g, start = math.hypot(*flow.gravity), float(flow.t[0])
    if not 0 <= start <= LATEST_START * math.sqrt(height / g):
        return (
            f"the first frame is not the start: its time is {start:.3g}, and the simulator "
            f"releases grains at rest at 0"
        )
    speed = float(np.nanmax(np.hypot(flow.u[0], flow.v[0]), initial=0.0))
    fastest = MORE_THAN_FREE_FALL * g * start + AT_REST * math.sqrt(g * height)
    if speed > fastest:
        return (
            f"the grains are not released from rest: they move at {speed:.3g} in the first frame, "
            f"free fall from rest explains at most {fastest:.3g}"
        )
    return None


def foreign_wall(flow: Flow) -> str | None:
    """Why the walls or forces of a flow are not those of the simulator; None if they are.

    Every stated wall must be one of the simulator, and a stated floor must reach as far as the
    grains: beside it may be an opening. A flow without walls fits; one with a source term does not.
    """
    if flow.source is not None:
        return "the flow has a source of momentum, which the simulator does not have"
    if flow.walls is None:
        return None
    walls = segments_of(flow.walls)
    dx, dy = flow.spacing
    x, y = walls.ends[..., 0], walls.ends[..., 1]
    known = (np.abs(y) <= NEAR * dy).all(axis=1)
    floor = known
    for place in (0.0, box_of(flow)):
        if place is not None:
            known = known | (np.abs(x - place) <= NEAR * dx).all(axis=1)
    still = (walls.velocity == 0).all(axis=(1, 2))
    if not bool((known & still).all()):
        name = walls.names()[walls.wall[np.argmin(known & still)]]
        return f"the simulator does not have {name} of the file"
    if flow.y[0] > dy:  # the window begins above the floor
        return None
    near = np.sort(x[floor], axis=1) + np.array([-dx, dx])
    under = ((flow.x[:, None] >= near[:, 0]) & (flow.x[:, None] <= near[:, 1])).any(axis=1)
    bare = flow.x[(flow.c[:, 0] >= 0.5).any(axis=0) & ~under]
    if not bare.size:
        return None
    return (
        f"the simulator has a floor at x = {bare[0]:.4g}, where the walls of the file leave it open"
    )


def in_corner(flow: Flow, k: int) -> bool:
    """Whether the grains of frame k touch the wall and the floor of the simulator."""
    dx, dy = flow.spacing
    return bool(abs(flow.x[0]) <= dx and abs(flow.y[0]) <= dy and flow.c[k, 0, 0] >= 0.5)


def extent(flow: Flow, full: Bool) -> GrainColumn:
    """The rectangle from the corner around the grains of a frame, `full` [Y, X]."""
    dx, dy = flow.spacing
    row, column = (int(np.flatnonzero(full.any(axis=k)).max()) for k in (1, 0))
    return GrainColumn(float(flow.x[column]) + dx / 2, float(flow.y[row]) + dy / 2)


def heights(flow: Flow) -> Float64:
    """How thick the grains lie at every x [T, X]."""
    thick: Float64 = flow.c.sum(axis=1, dtype=np.float64) * flow.spacing[1]
    return thick


def box_of(flow: Flow) -> float | None:
    """The width of the box in the file; None if the file lacks it."""
    return flow.stated("box_width") or flow.stated("domain_size")


def _box_width(flow: Flow, column: GrainColumn) -> float:
    stated = box_of(flow) or max(1.2 * column.height, 1.1 * float(flow.x[-1]))
    return max(stated, 0.5 * column.width)  # Collapse refuses so narrow a box


def cells_of(flow: Flow, column: GrainColumn) -> int:
    """Cells across the box by the grid of the solver that made the data, else by the data grid."""
    spacing = flow.stated(SOLVER_CELL) or flow.spacing[0]
    wanted = min(_box_width(flow, column) / spacing, MOST_CELLS)  # before an infinity is rounded
    return max(CELLS_MULTIPLE * round(wanted / CELLS_MULTIPLE), FEWEST_CELLS)


def collapse_of(
    flow: Flow,
    column: GrainColumn,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None,
    wall_friction: float | None = None,
) -> Collapse:
    """The settings of the simulation.

    Args:
        theta: parameters of the law, in its order.
        cells: across the box; None for the grid of the solver that made the data, or of the data.
        wall_friction: of side walls, if the flow states their distance; None: the usual one.

    Raises:
        ConfigError: they are invalid, or the box in the file is absurdly large beside its grains.
    """
    width, dx = _box_width(flow, column), flow.spacing[0]
    height = flow.stated("box_height") or flow.stated("domain_size") or 1.2 * column.height
    most = LARGEST_AREA * max(MOST_CELLS, cells or 0) ** 2
    cells = cells_of(flow, column) if cells is None else cells
    narrow = min(column) / (width / cells)
    gap = flow.stated(WALL_GAP)
    # The simulator has one density, so the grain density in the inertial number is a factor of d.
    denser = (flow.grain_density or flow.density) / flow.density
    collapse = Collapse(
        **law_settings(law, theta, flow.stated("cohesion")),
        d=flow.grain_diameter * math.sqrt(denser),
        density=flow.density,
        eta_min=flow.eta_min or None,
        eta_max=flow.eta_max or None,
        air_density=flow.stated("air_density"),
        air_viscosity=flow.stated("air_viscosity"),
        wall_gap=gap,
        wall_friction=None if gap is None else wall_friction,
        length_unit=flow.length_unit,
        time_unit=flow.time_unit,
        height=column.height,
        aspect=column.height / column.width,
        gravity=flow.gravity,
        box_width=width,
        box_height=height,
        cells=cells,
        t_end=float(flow.t[-1]),
        frames=len(flow.t),
        stride=max(1, min(round(dx * cells / width), int(narrow))),
    )
    width, height = collapse.box
    wanted = collapse.cells * (height / collapse.spacing)  # as a float: there may be too many
    if not wanted <= most:
        raise ConfigError(
            f"the box in the file, {width:g} x {height:g} around grains {collapse.width:g} wide "
            f"and {collapse.height:g} high, would take {wanted:.3g} cells of the simulator, at "
            f"most {most} are allowed: state box_width and box_height in the unit of x and y"
        )
    return collapse


def interpolation(source: Flow | Nodes, target: Flow | Nodes) -> Callable[[Any], Float64]:
    """Bilinear values of a frame of `source` at the grid of `target` [Y, X].

    NaN where one of the four points around is missing or has no value.
    """

    def places(own: Any, wanted: Any) -> tuple[Any, Any, Float64]:
        index = np.interp(wanted, own, np.arange(len(own)), left=np.nan, right=np.nan)
        nearest = np.round(index)
        index = np.where(np.abs(index - nearest) < 1e-6, nearest, index)
        low = np.floor(np.nan_to_num(index)).astype(int)
        part = index - low
        return low, np.where(part > 0, low + 1, low), part

    j, j_up, b = places(source.y, target.y)
    i, i_up, a = places(source.x, target.x)

    def at(frame: Any) -> Float64:
        f = np.asarray(frame, np.float64)
        rows = (1 - a) * f[:, i] + a * f[:, i_up]  # first along x: `source` may have fewer rows
        values: Float64 = (1 - b)[:, None] * rows[j] + b[:, None] * rows[j_up]
        return values

    return at
