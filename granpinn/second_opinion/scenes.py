"""The scene of the simulator that is like a flow, with a given law.

The simulator (granpinn/simulation) starts from the grains of the first frame, with the gravity,
density and grain diameter of the flow file. It can start only from rest: from a column in the lower
left corner of a box, or from an even layer with periodic sides (layers.py). Other flows have the
reason instead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Bool
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.data.flow import SOLVER_CELL, WALL_GAP
from granpinn.physics.laws import FrictionLaw
from granpinn.second_opinion import layers
from granpinn.second_opinion.boundaries import foreign_wall
from granpinn.second_opinion.limits import MOST_CELLS, require_few_cells, require_few_steps
from granpinn.simulation.chute import Chute
from granpinn.simulation.parameters import FEWEST_CELLS, Collapse
from granpinn.simulation.scene import CELLS_MULTIPLE, law_settings

LEAST_FILLED = 0.95  # share of the rectangle around the first frame's grains
LATEST_START = 0.1  # of the time in which the grains flow: latest time of the first frame
AT_REST = 0.02  # of sqrt(|g| H)
MORE_THAN_FREE_FALL = 1.5
STEADY = "the flow is steady, and the simulator has only grains that start from rest"
CORNER = "do not stand in the corner of wall and floor, which the simulator has at x = 0 and y = 0"


class GrainColumn(NamedTuple):
    """Grains as a column in the corner, in the units of the file."""

    width: float
    height: float


def initial_column(flow: Flow) -> GrainColumn | str:
    """The column at the start of a flow, or the reason why there is none."""
    if flow.steady:
        return STEADY
    full = flow.c[0] >= 0.5
    if not full.any():
        return "the first frame holds no grains"
    dx, dy = spacings(flow)
    if objection := foreign_wall(flow, box_of(flow)):
        return objection
    if not in_corner(flow, 0):
        return f"the grains of the first frame {CORNER}"
    measured = extent(flow, full)
    filled = float(full[np.ix_(flow.y < measured.height, flow.x < measured.width)].mean())
    if filled < LEAST_FILLED:
        return (
            f"the first frame is not a column: its grains fill {100 * filled:.0f} % of the "
            f"rectangle around them, at least {100 * LEAST_FILLED:.0f} % are expected"
        )
    g = math.hypot(*flow.gravity)
    if objection := not_from_rest(flow, measured.height, math.sqrt(measured.height / g)):
        return objection
    return GrainColumn(
        _stated(flow, "column_width", measured.width, dx),
        _stated(flow, "column_height", measured.height, dy),
    )


def initial_depth(flow: Flow) -> float | str:
    """The depth of a layer at the start of a flow, or the reason why there is none."""
    if flow.steady:
        return STEADY
    if objection := layers.not_a_layer(flow):
        return objection
    depth = layers.depth_of(flow, 0)
    # A layer takes H/d times longer to flow than a column.
    usual = depth / flow.grain_diameter * math.sqrt(depth / math.hypot(*flow.gravity))
    return not_from_rest(flow, depth, usual) or depth


def not_from_rest(flow: Flow, height: float, usual: float) -> str | None:
    """Why the first frame does not follow a release at t = 0 of grains of some height, or None.

    `usual` is the time in which such grains flow; the first frame is in a tenth of it.
    """
    g, start = math.hypot(*flow.gravity), float(flow.t[0])
    if not 0 <= start <= LATEST_START * usual:
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


def spacings(flow: Flow) -> tuple[float, float]:
    """Spacings of the grid along x and y."""
    return float(np.median(np.diff(flow.x))), float(np.median(np.diff(flow.y)))


def in_corner(flow: Flow, k: int) -> bool:
    """Whether the grains of frame k touch the wall and the floor of the simulator."""
    dx, dy = spacings(flow)
    return bool(abs(flow.x[0]) <= dx and abs(flow.y[0]) <= dy and flow.c[k, 0, 0] >= 0.5)


def extent(flow: Flow, full: Bool) -> GrainColumn:
    """The rectangle from the corner around the grains of a frame, `full` [Y, X]."""
    dx, dy = spacings(flow)
    row, column = (int(np.flatnonzero(full.any(axis=k)).max()) for k in (1, 0))
    return GrainColumn(float(flow.x[column]) + dx / 2, float(flow.y[row]) + dy / 2)


def _stated(flow: Flow, name: str, measured: float, spacing: float) -> float:
    """The length in the file if it agrees with the first frame, else the measured length."""
    stated = flow.stated(name)
    return stated if stated is not None and abs(stated - measured) <= spacing else measured


def box_of(flow: Flow) -> float | None:
    """The width of the box in the file; None if the file lacks it."""
    return flow.stated("box_width") or flow.stated("domain_size")


def _box_width(flow: Flow, column: GrainColumn) -> float:
    stated = box_of(flow) or max(1.2 * column.height, 1.1 * float(flow.x[-1]))
    return max(stated, 0.5 * column.width)  # Collapse refuses so narrow a box


def cells_of(flow: Flow, column: GrainColumn) -> int:
    """Cells across the box by the grid of the solver that made the data, else by the data grid."""
    spacing = flow.stated(SOLVER_CELL) or spacings(flow)[0]
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
    """The settings of the simulation; ConfigError if they are invalid.

    Args:
        theta: parameters of the law, in its order.
        cells: across the box, None for the grid of the data.
        wall_friction: of side walls, if the flow states their distance; None: the usual one.
    """
    width, dx = _box_width(flow, column), spacings(flow)[0]
    height = flow.stated("box_height") or flow.stated("domain_size") or 1.2 * column.height
    chosen = cells
    cells = cells_of(flow, column) if cells is None else cells
    # The simulator has one density, so the grain density in the inertial number is a factor of d.
    denser = (flow.grain_density or flow.density) / flow.density
    narrow = min(column) / (width / cells)
    gap = flow.stated(WALL_GAP)
    collapse = Collapse(
        **law_settings(law, theta, flow.stated("cohesion")),
        d=flow.grain_diameter * math.sqrt(denser),
        height=column.height,
        aspect=column.height / column.width,
        density=flow.density,
        gravity=flow.gravity,
        box_width=width,
        box_height=height,
        cells=cells,
        t_end=float(flow.t[-1]),
        frames=len(flow.t),
        stride=max(1, min(round(dx * cells / width), int(narrow))),
        eta_min=flow.eta_min or None,
        eta_max=flow.eta_max or None,
        air_density=flow.stated("air_density"),
        air_viscosity=flow.stated("air_viscosity"),
        wall_gap=gap,
        wall_friction=None if gap is None else wall_friction,
        length_unit=flow.length_unit,
        time_unit=flow.time_unit,
    )
    require_few_cells(collapse, chosen)
    return collapse


def scene_of(
    flow: Flow,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None = None,
    wall_friction: float | None = None,
) -> tuple[Collapse | Chute, GrainColumn | float] | str:
    """The scene of a flow with its column or the depth of its layer, or why there is none.

    Args:
        flow: as `symmetry.with_layer` gives it.
        theta, cells, wall_friction: as in `collapse_of` and `layers.chute_of`.
    """
    begin_with = initial_depth(flow) if flow.periodic else initial_column(flow)
    if isinstance(begin_with, str):
        return begin_with
    scene: Collapse | Chute
    try:
        if isinstance(begin_with, GrainColumn):
            scene = collapse_of(flow, begin_with, law, theta, cells, wall_friction)
        else:
            scene = layers.chute_of(flow, begin_with, law, theta, cells, wall_friction)
        require_few_steps(scene)
    except ConfigError as error:
        return str(error)
    return scene, begin_with
