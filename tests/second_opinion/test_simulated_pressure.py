"""Simulated pressure: equal to the simulator's for simulated data, or a reason for its absence."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import RegularGridInterpolator

from granpinn.checks.simulated_pressure import SimulatedPressure
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.fit.scoring import strain_rate
from granpinn.physics.laws import DEFAULT
from granpinn.results.zones import D2_STAGNANT
from granpinn.second_opinion import simulated_pressure
from granpinn.second_opinion.scenes import GrainColumn, collapse_of
from granpinn.simulation import Collapse, Engine, SimulationError, State
from granpinn.simulation.engine import Start
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.settling import settled_after

Array = npt.NDArray[np.float64]
THETA = (0.4, 0.64, 0.3)
TIMES = (0.5, 1.5, 2.5, 3.5)


class Known(NamedTuple):
    """A flow of the simulator and its velocity at any point."""

    flow: Flow
    velocity: simulated_pressure.Velocity


@pytest.fixture(scope="module")
def known() -> Known:
    recorder = Recorder(Collapse(*THETA[:2], cells=128, stride=2, threads=1))
    engine, starts = Engine(recorder.scene), list[State]()
    before = settled_after(recorder.scene)

    def run_to(t: float) -> State:
        while t - engine.time > 1e-9:
            engine.step(t - engine.time)
        return engine.state()

    for t in TIMES:
        starts.append(run_to(t - before))
        recorder.add(t, run_to(t))
    h = engine.spacing

    def at(faces: Array, corner: tuple[float, float], x: Array, y: Array) -> Array:
        axes = [h * (k + np.arange(n)) for k, n in zip(corner, faces.shape, strict=True)]
        within = RegularGridInterpolator(axes, faces, bounds_error=False, fill_value=0.0)
        return np.asarray(within((y, x)))

    def velocity(x: Array, y: Array, t: float) -> tuple[Array, Array]:
        (start,) = (s for s, end in zip(starts, TIMES, strict=True) if abs(end - before - t) < 1e-3)
        return at(start.u, (0.5, 0.0), x, y), at(start.v, (0.0, 0.5), x, y)

    return Known(recorder.flow(), velocity)


def nothing(x: Array, y: Array, t: float) -> tuple[Array, Array]:
    return np.zeros_like(x), np.zeros_like(y)


def stagnant(flow: Flow, k: int) -> npt.NDArray[np.bool_]:
    d2 = strain_rate(flow.u[k], flow.v[k], flow.y, flow.x)
    return np.asarray(flow.valid[k] & (d2 * math.sqrt(10) < D2_STAGNANT))


def error(p: Array, flow: Flow, k: int, where: npt.NDArray[np.bool_]) -> float:
    assert flow.p is not None
    found = relative_l2(p[where], flow.p[k][where])
    assert found is not None
    return found


def pressures(
    known: Known, theta: Any = THETA, velocity: Any = None, frames: int = 2, **others: Any
) -> dict[int, Any]:
    """The simulated pressure of these frames."""
    velocity = velocity or known.velocity
    found = simulated_pressure.at_frames(known.flow, DEFAULT, theta, velocity, frames, **others)
    assert not isinstance(found, str)
    return found.at


def test_the_velocity_of_the_simulator_gives_its_pressure_back(known: Known) -> None:
    flow = known.flow
    told: list[tuple[int, int]] = []
    with ThreadPoolExecutor(2) as pool:
        found = simulated_pressure.at_frames(
            flow,
            DEFAULT,
            THETA,
            known.velocity,
            4,
            pool=pool,
            listener=lambda *done: told.append(done),
        )
    assert not isinstance(found, str)
    assert (found.cells, list(found.at)) == (128, [0, 1, 2, 3])
    assert (found.failed, found.late) == (0, 0)
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    for k, p in found.at.items():
        rest = stagnant(flow, k)
        # What another solver differs by, about (bench/studies/simulator_validation).
        assert error(p, flow, k, flow.valid[k]) < 4
        assert error(p, flow, k, rest) < 4
        depth = (flow.c[k] > 0.5).sum(axis=0) * (flow.y[1] - flow.y[0]) - flow.y[:, None]
        assert error(depth, flow, k, rest) > 20


def test_another_law_or_grains_at_rest_have_another_pressure(known: Known) -> None:
    last = known.flow.valid[3]
    other = pressures(known, theta=(0.1, 0.2, 0.3), frames=1)
    still = pressures(known, velocity=nothing, frames=1)
    assert list(other) == list(still) == [3]
    assert error(other[3], known.flow, 3, last) > 8
    assert error(still[3], known.flow, 3, last) > 8


def elsewhere(flow: Flow) -> Flow:
    return dataclasses.replace(flow, x=flow.x + 5)


def before(flow: Flow) -> Flow:
    return dataclasses.replace(flow, t=flow.t - 5)


def cut_off(flow: Flow) -> Flow:
    top = np.s_[:, :4]
    cut = {name: getattr(flow, name)[top] for name in ("u", "v", "c", "p")}
    return dataclasses.replace(flow, **cut, y=flow.y[:4], attributes={})


def upwards(flow: Flow) -> Flow:
    return dataclasses.replace(flow, gravity=(0.0, 1.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (elsewhere, "the grains do not stand in the corner of wall and floor"),
        (before, "no frame after the start shows all of the grains"),
        (cut_off, "no frame after the start shows all of the grains"),
        (upwards, "gravity must be two numbers and point down"),
    ],
)
def test_what_the_simulator_cannot_have_is_said(
    change: Callable[[Flow], Flow], words: str, known: Known
) -> None:
    found = simulated_pressure.at_frames(change(known.flow), DEFAULT, THETA, known.velocity, 3)
    assert isinstance(found, str)
    assert words in found
    assert str(SimulatedPressure(found)) == f"no simulated pressure: {found}"


def test_a_frame_that_fails_is_left_out(known: Known, monkeypatch: pytest.MonkeyPatch) -> None:
    settle = simulated_pressure.settle

    def failing(collapse: Collapse, start: Start) -> State:
        if start.c.sum() == first:
            raise SimulationError("a solve did not converge")
        return settle(collapse, start)

    collapse = collapse_of(known.flow, GrainColumn(1.0, 10.0), DEFAULT, THETA, None)
    first = simulated_pressure.fraction_of(known.flow, 0, collapse, settled_after(collapse)).sum()
    monkeypatch.setattr(simulated_pressure, "settle", failing)
    found = simulated_pressure.at_frames(known.flow, DEFAULT, THETA, known.velocity, 4)
    assert not isinstance(found, str)
    assert list(found.at) == [1, 2, 3]
    assert found.failed == 1
    record = SimulatedPressure(None, found.cells, tuple(found.at), found.failed)
    assert "(left out: 1 did not converge)" in str(record)


def test_no_frame_is_begun_after_the_deadline(known: Known) -> None:
    deadline = time.monotonic() - 1
    found = simulated_pressure.at_frames(
        known.flow, DEFAULT, THETA, known.velocity, 4, deadline=deadline
    )
    assert not isinstance(found, str)
    assert (found.at, found.late) == ({}, 4)
    assert "(left out: 4 had no time left)" in str(SimulatedPressure(None, late=4))
