"""Layers on a slope with periodic sides, such as chutes, in the simulator.

The simulator has an even layer on a floor at y = 0 (granpinn/simulation/chute.py). It computes a
few columns, and every column of the data gets their mean. A flow that is another one gets the
reason instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from granpinn.arrays import Float32, Float64, Floats
from granpinn.data import Flow
from granpinn.data.flow import SOLVER_CELL, WALL_GAP
from granpinn.data.surface import line_heights
from granpinn.data.symmetry import same_along_x
from granpinn.physics.laws import FrictionLaw
from granpinn.second_opinion.boundaries import foreign_wall
from granpinn.simulation.chute import FEWEST_CELLS, STEEPEST, Chute
from granpinn.simulation.engine import Start, State
from granpinn.simulation.scene import law_settings

FEWEST_ROWS, MOST_ROWS = 32, 128  # cells across the layer, unless the settings have a number

Velocity = Callable[[Float64, Float64, float], tuple[Float64, Float64]]


def not_a_layer(flow: Flow) -> str | None:
    """Why the simulator cannot have a flow with periodic sides; None if it may."""
    if objection := foreign_wall(flow, None):
        return objection
    g_x, g_y = flow.gravity
    if not 0 <= g_x <= -g_y * math.tan(math.radians(STEEPEST)):
        return (
            f"gravity is ({g_x:g}, {g_y:g}), and a chute of the simulator descends along x, by at "
            f"most {STEEPEST:g} degrees"
        )
    if flow.particles is not None or not same_along_x(flow):
        return "the flow changes along x, and a layer of the simulator is even"
    if abs(flow.y[0]) > float(np.median(np.diff(flow.y))):
        return "the grains do not lie on the floor that the simulator has at y = 0"
    return None


def depth_of(flow: Flow, k: int) -> float:
    """The thickness of the layer in frame k, from the surface line if there is one."""
    if flow.surface is None:
        thick = flow.c[k].sum(axis=0, dtype=np.float64) * float(np.median(np.diff(flow.y)))
        return float(thick.mean())
    s = flow.surface
    return float(np.nanmean(line_heights(flow.t[k : k + 1], flow.x, s)))


def chute_of(
    flow: Flow,
    depth: float,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None,
    wall_friction: float | None = None,
) -> Chute:
    """The settings of the simulation; ConfigError if they are invalid.

    Args:
        depth: of the layer.
        theta: parameters of the law, in its order.
        cells: across the layer; None for the grid of the solver that made the data, or of the data.
        wall_friction: of side walls, if the flow states their distance; None: the usual one.
    """
    g_x, g_y = flow.gravity
    solver, data = flow.stated(SOLVER_CELL), float(np.median(np.diff(flow.y)))
    own = depth / solver if solver else max(depth / data, FEWEST_ROWS)
    wanted = min(own, MOST_ROWS) if cells is None else cells
    # The simulator has one density, so the grain density in the inertial number is a factor of d.
    denser = (flow.grain_density or flow.density) / flow.density
    last, gap = float(flow.t[-1]), flow.stated(WALL_GAP)
    return Chute(
        **law_settings(law, theta, flow.stated("cohesion")),
        wall_gap=gap,
        wall_friction=None if gap is None else wall_friction,
        d=flow.grain_diameter * math.sqrt(denser),
        height=depth,
        density=flow.density,
        slope=math.degrees(math.atan2(g_x, -g_y)),
        g=math.hypot(g_x, g_y),
        cells=max(round(wanted), FEWEST_CELLS),
        t_end=last if last > 0 else None,
        frames=max(len(flow.t), 2),
        eta_min=flow.eta_min or None,
        eta_max=flow.eta_max or None,
        air_density=flow.stated("air_density"),
        air_viscosity=flow.stated("air_viscosity"),
        length_unit=flow.length_unit,
        time_unit=flow.time_unit,
    )


def spread(simulated: Flow, x: Float64) -> Flow:
    """A simulated layer at other places x along the slope: the mean of its columns."""

    def at(values: Floats) -> Float32:
        mean = values.mean(axis=2, keepdims=True)
        return np.repeat(mean, len(x), axis=2).astype(np.float32)

    u, v, c = at(simulated.u), at(simulated.v), at(simulated.c)
    return replace(simulated, x=x, u=u, v=v, c=c, p=None, surface=None)


def start_of(chute: Chute, velocity: Velocity, time: float) -> Start:
    """The even layer of a resolved chute with a velocity along the slope."""
    h, c = chute.spacing, chute.start_fraction()
    ny, nx = c.shape
    rows = int((c[:, 0] > 0).sum())
    y = h * (np.arange(rows, dtype=np.float64) + 0.5)
    u = np.zeros((ny, nx + 1))
    u[:rows] = velocity(np.zeros(rows), y, time)[0][:, None]
    u[rows:] = u[rows - 1]  # the air moves with the surface
    return Start(c, u, np.zeros((ny + 1, nx)))


def pressure_at(flow: Flow, state: State, spacing: float) -> Float64:
    """The pressure of a state at the grid of a flow [Y, X]; linear beyond its ends."""
    y = spacing * (np.arange(len(state.p)) + 0.5)
    p = state.p.mean(axis=1)
    rows = np.interp(flow.y, y, p)
    below = flow.y < y[0]
    rows[below] = p[0] + (flow.y[below] - y[0]) * (p[1] - p[0]) / spacing
    return np.repeat(rows[:, None], len(flow.x), axis=1)
