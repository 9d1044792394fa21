"""Runs a simulation from its first to its last frame."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

from granpinn.config import ConfigError
from granpinn.data.constants import check_constants
from granpinn.data.flow import Flow, FlowFileError
from granpinn.data.writer import write_flow
from granpinn.declared import checked
from granpinn.errors import Interrupted
from granpinn.simulation.engine import Engine, SimulationError, State
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.progress import SilentSimulation
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.scene import Scene

DEMO = "collapse_0.40_0.64.h5"


class Taker(Protocol):
    """Receiver of the frames of a run, such as a Recorder."""

    @property
    def scene(self) -> Scene: ...

    def add(self, time: float, state: State) -> None: ...


@checked
def simulate(
    scene: Scene | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    listener: SilentSimulation | None = None,
    **settings: Any,
) -> Flow:
    """Simulates the collapse of a column of grains, or another scene.

    Args:
        scene: what to simulate, such as `Chute(slope=24)`; or give the fields of a collapse as
            keywords, such as mu_s=0.4, cells=128.
        out: flow file to write.
        listener: its `show` gets the report of every step (simulation/progress.py).

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
            check_constants(**recorder.constants())
        except FlowFileError as error:
            raise ConfigError(f"the flow file cannot hold this simulation: {error}") from None
    try:
        record(recorder, listener or SilentSimulation())
    except (KeyboardInterrupt, SimulationError) as error:
        if out is None:
            raise
        kept = _keep(recorder, out)
        if isinstance(error, SimulationError):
            raise SimulationError(f"{error}; {kept}") from error
        signum = error.signum if isinstance(error, Interrupted) else signal.SIGINT
        raise Interrupted(signum, f"stopped by {signal.Signals(signum).name}; {kept}") from None
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


def record(taker: Taker, listener: SilentSimulation, times: Sequence[float] | None = None) -> None:
    """Simulates `taker.scene` and calls `taker.add` for every frame.

    Args:
        times: of the frames, increasing; by default those of the scene.
    """
    scene = taker.scene
    assert scene.t_end is not None  # resolved
    engine = Engine(scene)
    listener.start(scene.t_end)
    try:
        if times is None:
            times = [scene.t_end * k / scene.frames for k in range(1, scene.frames + 1)]
        for time in times:
            while time - engine.time > 1e-9 * scene.t_end:
                listener.show(engine.step(time - engine.time))
            taker.add(time, engine.state())
    finally:
        listener.stop()


def demo_path() -> Path:
    """The flow file of the package, a collapse made by this simulator."""
    return Path(str(files("granpinn") / "demo" / DEMO))
