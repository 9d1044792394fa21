"""Runs a simulation from its first to its last frame, and makes a flow of the frames.

Velocity and pressure are recorded at every `stride`-th cell center. They are NaN unless the cell
holds nothing but grains. The surface of a collapse consists of all cells of the full grid with
|c - 0.5| < 0.1, as in the paper. In a chute it is the height of the grains in every column of
cells, with the pressure of the air above: an even surface lies between two rows.
"""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import granpinn
from granpinn.arrays import Float32, Float64, Floats
from granpinn.config import ConfigError
from granpinn.data.flow import (
    SOLVER_CELL,
    SOLVER_MEAN,
    WALL_GAP,
    Flow,
    FlowFileError,
    Surface,
    Truth,
)
from granpinn.data.flow_file import write_flow
from granpinn.data.rules import check_constants
from granpinn.declared import checked
from granpinn.errors import Interrupted
from granpinn.progress import Progress, by_default
from granpinn.simulation.collapse import Collapse
from granpinn.simulation.engine import Engine, SimulationError, State
from granpinn.simulation.scene import Scene

SURFACE_HALF_WIDTH = 0.1


class Recorder:
    """Collects frames and turns them into a flow at any time."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene.resolved()
        self.times: list[float] = []
        self.frames: list[dict[str, Float64]] = []
        self.surface: list[Float64] = []  # [n, 4]: t, x, y, p

    def add(self, time: float, state: State) -> None:
        """Adds a frame: fields at the strided cell centers, and all surface points."""
        step, h = self.scene.stride, self.scene.spacing
        fields = {"u": state.u_center, "v": state.v_center, "p": state.p, "c": state.c}
        self.frames.append({name: field[::step, ::step].copy() for name, field in fields.items()})
        self.times.append(time)
        x, y, p = (column_heights if self.scene.PERIODIC else half_full_cells)(state, h)
        self.surface.append(np.stack([np.full(len(x), time), x, y, p], axis=1))

    def flow(self) -> Flow:
        """The frames so far, cut to the grains and the surface."""
        s, points = self.scene, np.concatenate(self.surface)
        occupied = [np.argwhere(frame["c"] > 0).max(axis=0) for frame in self.frames]
        # The surface is on all cells: its last ones may lie between two points of the grid.
        beyond = np.ceil((points[:, [2, 1]] / s.spacing - 0.5).round() / s.stride)
        ny, nx = np.concatenate([occupied, beyond]).max(axis=0) + 1
        if s.PERIODIC:  # every place once
            nx = min(nx, math.ceil(s.cells_x / s.stride))
        arrays = {name: self._stack(name, int(ny), int(nx)) for name in ("c", "u", "v", "p")}
        for name in ("u", "v", "p"):
            arrays[name][arrays["c"] < 1] = np.nan
        spacing, first = s.stride * s.spacing, 0.5 * s.spacing
        t, x, y, p = points.T.copy()
        return Flow(
            t=np.array(self.times),
            y=first + spacing * np.arange(ny),
            x=first + spacing * np.arange(nx),
            u=arrays["u"],
            v=arrays["v"],
            c=arrays["c"],
            p=arrays["p"],
            surface=Surface(t, x, y, p.astype(np.float32)) if len(points) else None,
            **self.constants(),
        )

    def constants(self) -> dict[str, Any]:
        """The fields of the flow that are known before the first frame."""
        s = self.scene
        return {
            "gravity": s.gravity,
            "density": s.density,
            "grain_diameter": s.d,
            "length_unit": s.length_unit,
            "time_unit": s.time_unit,
            "eta_max": s.eta_max,
            "eta_min": s.eta_min,
            "truth": Truth(law=s.law, **dict(zip(s.friction_law.names, s.theta, strict=True))),
            "attributes": self._settings(),
        }

    def _stack(self, name: str, ny: int, nx: int) -> Float32:
        """One quantity of all frames [T, ny, nx]; 0 beyond the window of a frame."""
        out = np.zeros((len(self.frames), ny, nx), np.float32)
        for k, frame in enumerate(self.frames):
            part = frame[name][:ny, :nx]
            out[k, : part.shape[0], : part.shape[1]] = part
        return out

    def _settings(self) -> dict[str, float | str | None]:
        """Settings of the simulation for which the format has no attribute of its own."""
        s = self.scene
        walls = {WALL_GAP: s.wall_gap, "true_wall_friction": s.wall_friction}
        return {
            **({} if s.wall_gap is None else walls),
            "source": f"granpinn {granpinn.__version__} simulation",
            **s.shape_attributes(),
            SOLVER_CELL: s.spacing,
            SOLVER_MEAN: s.spacing,  # csrc/collapse: a mean 1-2-1 over three cells
            "stride": s.stride,
            "air_density": s.air_density,
            "air_viscosity": s.air_viscosity,
            "cohesion": s.cohesion,
            "cfl": s.cfl,
        }


def half_full_cells(state: State, h: float) -> tuple[Floats, Floats, Floats]:
    """x, y and p [n] of the cells with c near 1/2; h is the cell size."""
    j, i = np.nonzero(np.abs(state.c - 0.5) < SURFACE_HALF_WIDTH)
    return (i + 0.5) * h, (j + 0.5) * h, state.p[j, i]


def column_heights(state: State, h: float) -> tuple[Floats, Floats, Floats]:
    """x of the columns of cells, the height of their grains and the pressure of the air above."""
    cells: Float64 = state.c.sum(axis=0)
    i = np.arange(cells.size)
    j = np.minimum(np.ceil(cells - 1e-6).astype(int), len(state.c) - 1)
    return (i + 0.5) * h, cells * h, state.p[j, i]


DEMO = "collapse_0.40_0.64.h5"


@checked
def simulate(
    scene: Scene | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Flow:
    """Simulates the collapse of a column of grains, or another scene.

    Args:
        scene: what to simulate, such as `Chute(slope=24)`; or give the fields of a collapse as
            keywords, such as mu_s=0.4, cells=128.
        out: flow file to write.
        progress: a listener, as in `identify`.

    Returns:
        The flow, with the true parameters.

    Raises:
        ConfigError: the scene cannot be simulated; one sentence.
        SimulationError: a solve did not converge.
        Interrupted: Ctrl-C, with `out`. Like SimulationError, it comes after the frames so far have
            been written to `out`, if there are two; the message says what was written.
    """
    if scene is not None and settings:
        raise TypeError("give either a scene or the fields of a collapse as keywords, not both")
    recorder = Recorder(scene or Collapse(**settings))
    if out is not None:
        try:
            arrays: dict[str, Any] = dict.fromkeys("tyxuvc", np.empty(0))
            check_constants(Flow(**arrays, **recorder.constants()))
        except FlowFileError as error:
            raise ConfigError(f"the flow file cannot hold this simulation: {error}") from None
    progress = progress or by_default()
    try:
        for time, state in states(recorder.scene, progress):
            recorder.add(time, state)
    except (KeyboardInterrupt, SimulationError) as error:
        if out is None:
            raise
        kept = _keep(recorder, out)
        if isinstance(error, SimulationError):
            raise SimulationError(f"{error}; {kept}") from error
        signum = error.signum if isinstance(error, Interrupted) else signal.SIGINT
        raise Interrupted(signum, f"stopped by {signal.Signals(signum).name}; {kept}") from None
    finally:
        progress.stop()
    flow = recorder.flow()
    if out is not None:
        write_flow(flow, out)
    return flow


def _keep(recorder: Recorder, out: str | os.PathLike[str]) -> str:
    """Write the frames so far of a simulation that has stopped; says what was written."""
    count = len(recorder.frames)
    if count < 2:  # a file of one frame would be that of a steady flow
        return f"no flow file was written, since it needs two frames and there are {count}"
    write_flow(recorder.flow(), out)
    return f"{out} holds the {count} frames so far"


def states(scene: Scene, progress: Progress) -> Iterator[tuple[float, State]]:
    """Simulate a scene: the time and the state of every frame."""
    engine = Engine(scene)
    t_end, frames = engine.scene.t_end, engine.scene.frames
    assert t_end is not None  # resolved
    progress.at("t", 0.0, t_end)
    for k in range(1, frames + 1):
        at = t_end * k / frames
        while at - engine.time > 1e-9 * t_end:
            report = engine.step(at - engine.time)
            progress.at("t", report.time, t_end, report.words)
        yield at, engine.state()


def demo_path() -> Path:
    """The flow file of the package, a collapse made by this simulator."""
    return Path(str(files("granpinn") / "demo" / DEMO))
