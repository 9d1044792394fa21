"""The flows of the study: collapses of one law, and collapses that break it in a planted way.

Every flow is a function of (kind, number). A violation breaks the law, the geometry or the units of
a flow that is drawn like the clean ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from bench.studies.laws.population import HEIGHT, column
from granpinn import _collapse
from granpinn.arrays import Float64
from granpinn.data import Flow, Walls, write_flow
from granpinn.simulation import Collapse
from granpinn.simulation.engine import Engine, State
from granpinn.simulation.recorder import Recorder

MU_S, SLOPE = (0.25, 0.5), (0.1, 0.3)  # slope: mu_2 - mu_s
CHANGE = 0.2  # of the friction, in time or between two materials
LINE = 2.0  # grains by which the surface line is too high
FASTER = 1.1  # factor on the times of the film
VISCOSITY = (0.3, 3.0)  # of the Newtonian fluid, log-uniform, in sqrt(g H) H / 31.6
GAP = (0.15, 0.3)  # of the side walls, in heights
WALL_FRICTION = 0.15

Factor = Callable[[float, Float64], Float64]  # (time, first x of the grains) -> factor


class Kind(NamedTuple):
    """A kind of flow, and the parts that a verdict should name.

    Attributes:
        named: splits (granpinn/results/parts.py), each with whether its second half may need more
            friction; one of them is enough. None: any split counts.
    """

    named: tuple[tuple[str, tuple[bool, ...]], ...] = ()


CLEAN = "clean"
KINDS = {
    CLEAN: Kind(),
    "newtonian": Kind(),
    "time": Kind((("time", (True,)),)),
    "materials": Kind((("side", (True,)),)),
    "side_walls": Kind(),
    "surface_line": Kind(),
    "slip": Kind((("height", (True, False)),)),
    "clock": Kind((("time", (True, False)),)),
}


def scene(number: int, cells: int, stride: int, frames: int) -> Collapse:
    """The collapse behind the flows of a number."""
    draw = np.random.default_rng((19, number))
    mu_s = float(draw.uniform(*MU_S))
    mu_2 = mu_s + float(draw.uniform(*SLOPE))
    return column(draw, cells, stride, frames, mu_s=mu_s, mu_2=mu_2)


def make(kind: str, number: int, folder: Path, cells: int, stride: int, frames: int) -> Path:
    """The file of a flow; an earlier one is kept."""
    path = folder / f"{kind}-{number:03d}-{cells}-{stride}-{frames}.h5"
    if not path.exists():
        write_flow(flow_of(kind, number, cells, stride, frames), path)
    return path


def flow_of(kind: str, number: int, cells: int, stride: int, frames: int) -> Flow:
    """A flow as an experiment would give it, with the true parameters of its first material."""
    draw = np.random.default_rng((7, number))
    base = scene(number, cells, stride, frames)
    assert base.t_end is not None
    middle, change = base.width / 2, base.t_end / 3  # at a third, half of the motion is over
    overrides: dict[str, Any] = {}
    factor: Factor | None = None
    if kind == "newtonian":
        overrides = {"newtonian": True}
        eta = float(np.exp(draw.uniform(*np.log(VISCOSITY))))
        base = dataclasses.replace(base, eta_max=eta)
    elif kind == "time":
        factor = lambda time, x: np.full(x.shape, 1 + CHANGE * (time > change))  # noqa: E731
    elif kind == "materials":
        factor = lambda _, x: np.asarray(1 + CHANGE * (x > middle))  # noqa: E731
    elif kind == "side_walls":
        gap = float(draw.uniform(*GAP)) * HEIGHT
        base = dataclasses.replace(base, wall_gap=gap, wall_friction=WALL_FRICTION)
    elif kind == "slip":
        overrides = {"bottom": _collapse.Side.free_slip}
    flow = simulated(base, factor, overrides)
    attributes = {k: v for k, v in flow.attributes.items() if "wall" not in k}
    flow = dataclasses.replace(flow, eta_min=None, eta_max=None, p=None, attributes=attributes)
    surface = flow.surface
    assert surface is not None
    if kind == "surface_line":
        moved = dataclasses.replace(surface, y=surface.y + LINE * flow.grain_diameter)
        flow = dataclasses.replace(flow, surface=moved)
    if kind == "slip":
        flow = dataclasses.replace(flow, walls=floor(flow))
    if kind == "clock":
        later = dataclasses.replace(surface, t=FASTER * surface.t)
        slower = {name: getattr(flow, name) / np.float32(FASTER) for name in ("u", "v")}
        flow = dataclasses.replace(flow, t=FASTER * flow.t, surface=later, **slower)
    return flow


def floor(flow: Flow) -> Walls:
    """A floor on which grains do not slip."""
    x = np.array([0.0, float(flow.x[-1] + flow.x[0])])
    return Walls(x, np.zeros(2), slip=np.zeros(2, np.float32))


def simulated(base: Collapse, factor: Factor | None, overrides: dict[str, Any]) -> Flow:
    """The flow of a collapse whose friction has a factor in place and time."""
    recorder, engine = Recorder(base), Engine(base, **overrides)
    s = engine.scene
    assert s.t_end is not None
    h = s.spacing
    first = np.broadcast_to((np.arange(s.cells_x) + 0.5) * h, (s.cells_y, s.cells_x)).copy()
    for k in range(1, s.frames + 1):
        time = s.t_end * k / s.frames
        while time - engine.time > 1e-9 * s.t_end:
            if factor is not None:
                engine.set_friction_factor(factor(engine.time, first))
            report = engine.step(time - engine.time)
            if factor is not None:
                first = carried(first, engine.state(), report.step / h)
        recorder.add(engine.time, engine.state())
    return recorder.flow()


def carried(values: Float64, state: State, cells: float) -> Float64:
    """Values at cell centers that move with the flow, after a step of dt/h (semi-Lagrangian)."""
    u, v = state.u_center, state.v_center
    j, i = np.indices(u.shape, dtype=np.float64)
    new = values.copy()
    back = [j - cells * v, i - cells * u]
    new[: u.shape[0], : u.shape[1]] = map_coordinates(values, back, order=1, mode="nearest")
    return new
