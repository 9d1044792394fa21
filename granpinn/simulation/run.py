"""Runs a simulation from its first to its last frame."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

from granpinn.data.flow import Flow
from granpinn.data.writer import write_flow
from granpinn.simulation.engine import Engine, State
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.progress import Silent
from granpinn.simulation.recorder import Recorder

DEMO = "collapse_0.40_0.64.h5"


class Taker(Protocol):
    """Receiver of the frames of a run, such as a Recorder."""

    collapse: Collapse

    def add(self, time: float, state: State) -> None: ...


def simulate(
    collapse: Collapse | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    listener: Silent | None = None,
    **settings: Any,
) -> Flow:
    """Simulates the collapse of a column of grains.

    Args:
        collapse: what to simulate; or give its fields as keywords, such as mu_s=0.4, cells=128.
        out: flow file to write.
        listener: its `show` gets the report of every step (simulation/progress.py).

    Returns:
        The flow, with the true parameters. Interrupted by Ctrl-C, the frames so far are written to
        `out` before KeyboardInterrupt goes on; the same holds for a solve that fails.

    Raises:
        ConfigError: the collapse cannot be simulated; one sentence.
        SimulationError: a solve did not converge.
    """
    if collapse is not None and settings:
        raise TypeError("give either a Collapse or its fields as keywords, not both")
    recorder = Recorder(collapse or Collapse(**settings))
    finished = False
    try:
        record(recorder, listener or Silent())
        finished = True
    finally:
        # A flow file needs two frames.
        if out is not None and (finished or len(recorder.frames) >= 2):
            write_flow(recorder.flow(), out)
    return recorder.flow()


def record(taker: Taker, listener: Silent, times: Sequence[float] | None = None) -> None:
    """Simulates `taker.collapse` and calls `taker.add` for every frame.

    Args:
        times: of the frames, increasing; by default those of the collapse.
    """
    collapse = taker.collapse
    assert collapse.t_end is not None  # resolved
    engine = Engine(collapse)
    listener.start(collapse.t_end)
    try:
        if times is None:
            times = [collapse.t_end * k / collapse.frames for k in range(1, collapse.frames + 1)]
        for time in times:
            while time - engine.time > 1e-9 * collapse.t_end:
                listener.show(engine.step(time - engine.time))
            taker.add(time, engine.state())
    finally:
        listener.stop()


def demo_path() -> Path:
    """The flow file of the package, a collapse made by this simulator."""
    return Path(str(files("granpinn") / "demo" / DEMO))
