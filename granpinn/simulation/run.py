"""Runs a simulation from its first to its last frame."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from granpinn.config import ConfigError
from granpinn.data.flow import Flow, FlowFileError
from granpinn.data.rules import check_constants
from granpinn.data.writer import write_flow
from granpinn.declared import checked
from granpinn.errors import Interrupted
from granpinn.simulation.engine import Engine, SimulationError, State, StepReport
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.scene import Scene
from granpinn.terminal import say

DEMO = "collapse_0.40_0.64.h5"


Listener = Callable[[StepReport], object]  # called after every step


@checked
def simulate(
    scene: Scene | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    listener: Listener | None = None,
    **settings: Any,
) -> Flow:
    """Simulates the collapse of a column of grains, or another scene.

    Args:
        scene: what to simulate, such as `Chute(slope=24)`; or give the fields of a collapse as
            keywords, such as mu_s=0.4, cells=128.
        out: flow file to write.
        listener: called with the report of every step.

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
        for time, state in states(recorder.scene, listener=listener):
            recorder.add(time, state)
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


def states(
    scene: Scene, times: Sequence[float] | None = None, listener: Listener | None = None
) -> Iterator[tuple[float, State]]:
    """Simulate a scene: the time and the state of every frame.

    Args:
        times: of the frames, increasing; by default those of the scene.
        listener: called with the report of every step; its errors end the simulation.
    """
    engine = Engine(scene)
    t_end, frames = engine.scene.t_end, engine.scene.frames
    assert t_end is not None  # resolved
    for at in times or [t_end * k / frames for k in range(1, frames + 1)]:
        while at - engine.time > 1e-9 * t_end:
            report = engine.step(at - engine.time)
            if listener is not None:
                listener(report)
        yield at, engine.state()


def demo_path() -> Path:
    """The flow file of the package, a collapse made by this simulator."""
    return Path(str(files("granpinn") / "demo" / DEMO))


LINE_EVERY = 10.0  # seconds


def lines(
    t_end: float, say: Callable[[str], None] = say, every: float = LINE_EVERY
) -> Callable[[StepReport], None]:
    """A listener that says a line every ten seconds, by default to stderr."""
    begin = said = time.monotonic()

    def show(report: StepReport) -> None:
        nonlocal said
        now = time.monotonic()
        if now - said < every:
            return
        said = now
        left = (now - begin) / report.time * (t_end - report.time)
        say(
            f"t {report.time:.3g}/{t_end:.3g}  dt {report.step:.2g}  iterations "
            f"{report.viscous_iterations}+{report.pressure_iterations}  window "
            f"{report.window[0]}x{report.window[1]}  {left:.0f} s left"
        )

    return show
