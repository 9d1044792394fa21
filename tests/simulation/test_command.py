"""The command, the Python call, the flow file that they write, and how they stop."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granpinn
from granpinn.commands import simulate as command
from granpinn.progress import Lines, Progress
from granpinn.simulation import Collapse, SimulationError
from granpinn.simulation.engine import Engine

COARSE = {"cells": 64, "frames": 4, "t_end": 1.0, "stride": 2, "threads": 1}


FLAGS = [text for name, v in COARSE.items() for text in (f"--{name.replace('_', '-')}", str(v))]


# The command with a line for every step.
TALKATIVE = """
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell in the background ignores it
from granpinn.commands import simulate as command
from granpinn.progress import Lines
Lines.every = 0.0
sys.exit(command.main(sys.argv[1:]))
"""


def test_flow_file_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    assert command.main(["--mu-s", "0.3", "--mu-2", "0.5", *FLAGS, "--out", str(path)]) == 0
    flow = granpinn.read_flow(path)
    assert flow.truth is not None
    assert (flow.truth.mu_s, flow.truth.mu_2, flow.truth.I0) == (0.3, 0.5, 0.3)
    np.testing.assert_allclose(flow.t, [0.25, 0.5, 0.75, 1.0])
    assert flow.gravity == (0.0, -1.0)
    assert (flow.eta_max, flow.eta_min, flow.grain_diameter) == (1e4, 1e-4, 0.025)
    assert flow.x[0] == flow.y[0] == pytest.approx(0.5 * 12 / 64)
    assert np.diff(flow.x) == pytest.approx(2 * 12 / 64)
    assert flow.p is not None
    np.testing.assert_array_equal(np.isnan(flow.u), ~flow.material)
    np.testing.assert_array_equal(np.isnan(flow.p), ~flow.material)
    assert flow.surface is not None
    assert flow.surface.p is not None
    assert np.abs(np.median(flow.surface.p)) < 0.05
    assert flow.attributes["column_width"] == 1.0
    falling = flow.v[-1][flow.material[-1]].min()
    assert falling == pytest.approx(-1.0, abs=0.05)  # the top falls freely


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_signal_leaves_the_frames_so_far(name: str, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    settings = ["--cells", "256", "--t-end", "5", "--frames", "2000", "--threads", "1"]
    process = subprocess.Popen(
        [sys.executable, "-c", TALKATIVE, *settings, "--out", str(path)],
        stderr=subprocess.PIPE,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    assert process.stderr is not None
    for _ in range(10):  # steps, and so at least as many frames
        assert process.stderr.readline().startswith(b"t ")
    process.send_signal(getattr(signal, name))
    _, error = process.communicate(timeout=60)
    assert process.returncode == 128 + getattr(signal, name)
    assert re.search(rb"flow.h5 holds the \d+ frames so far\n$", error)
    flow = granpinn.read_flow(path)
    assert 2 <= len(flow.t) < 2000


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_signal_before_two_frames_says_that_there_is_no_file(
    signum: signal.Signals,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Stopper(Progress):
        def at(self, name: str, done: float, total: float, text: str = "") -> None:
            signal.raise_signal(signum)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(command, "automatic", Stopper)
    try:
        code = command.main([*FLAGS, "--out", str(tmp_path / "flow.h5")])
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == 128 + signum
    assert capsys.readouterr().err == (
        f"granpinn.simulate: stopped by {signum.name}; no flow file was written, since it needs "
        "two frames and there are 0\n"
    )
    assert not list(tmp_path.iterdir())


def test_failed_solve_stops_with_its_numbers(tmp_path: Path) -> None:
    class Spoiler(Progress):
        def at(self, name: str, done: float, total: float, text: str = "") -> None:
            if done > 0.6:
                raise SimulationError("the viscous solve stopped")

    with pytest.raises(SimulationError):
        granpinn.simulate(out=tmp_path / "flow.h5", progress=Spoiler(), **COARSE)
    assert len(granpinn.read_flow(tmp_path / "flow.h5").t) == 2

    with pytest.raises(SimulationError, match="pressure solve of step 0 .* after 1 iterations"):
        Engine(Collapse(cells=64, threads=1), largest_iteration_count=1)


def test_progress_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Lines, "every", 0.0)
    granpinn.simulate(progress=Lines(), **COARSE)
    said = capsys.readouterr().err.splitlines()
    assert len(said) >= 4
    assert "iterations" in said[-1]
    assert said[-1].endswith(" left")
    assert said[-1].startswith("t 1/1  dt ")
