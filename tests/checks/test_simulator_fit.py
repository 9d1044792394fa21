"""The fit of the simulator finds the law of simulated data, with errors that match its std."""

from __future__ import annotations

import dataclasses
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from granpinn.checks import simulator_fit
from granpinn.checks.simulator_fit import SimulatorFit, fit
from granpinn.data import Flow, add_noise
from granpinn.results.decoding import decode
from granpinn.second_opinion import law_runs
from granpinn.second_opinion.law_runs import LawRuns
from granpinn.second_opinion.scenes import GrainColumn, initial_column
from granpinn.simulation import Collapse, simulate

LAW = (0.4, 0.64)


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(*LAW, cells=64, stride=2, frames=20, t_end=3.0, threads=1))


@pytest.fixture(scope="module")
def runs(flow: Flow) -> LawRuns:
    return law_runs_of(flow, 0.3)


def law_runs_of(flow: Flow, I0: float, cells: int | None = None, free_I0: bool = False) -> LawRuns:
    column = initial_column(flow)
    assert isinstance(column, GrainColumn)
    return LawRuns(flow, column, I0, cells, free_I0)


def test_it_finds_the_law_of_its_own_run(flow: Flow, runs: LawRuns) -> None:
    found = fit(flow, runs, (0.41, 0.68))
    assert found.inside
    assert found.cells == 64
    assert abs(found.mu_s / LAW[0] - 1) < 0.005
    assert abs(found.mu_2 / LAW[1] - 1) < 0.01
    assert found.misfit_percent < 1


def test_its_scatter_over_noise_is_the_stated_one(flow: Flow, runs: LawRuns) -> None:
    clean = fit(flow, runs, (0.41, 0.68))
    draws = [fit(add_noise(flow, 0.03, seed), runs, (0.41, 0.68)) for seed in range(24)]
    for name, k in (("mu_s", 0), ("mu_2", 1)):
        pulls = [(getattr(f, name) - getattr(clean, name)) / f.std[k] for f in draws]
        assert 0.65 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.5  # 24 draws: 1 +- 0.15


def test_fits_at_the_same_time_share_their_runs(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, together = [], threading.Barrier(4)

    def run(self: LawRuns, collapse: Collapse) -> np.ndarray:
        made.append((collapse.mu_s, collapse.mu_2))
        time.sleep(0.05)
        return np.full((2, 3), collapse.mu_s, np.float32)

    monkeypatch.setattr(LawRuns, "_run", run)
    runs = law_runs_of(flow, 0.3)
    nodes = [(-120, -38), (-118, -38), (-118, -36)]

    def ask(_: int) -> list[np.ndarray]:
        together.wait()
        return runs.velocities(64, nodes)

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(ask, range(4)))
    assert runs.made == len(made) == len(set(made)) == 3
    expected = [float(np.exp(law_runs.SPACING[0] * node[0])) for node in nodes]
    for answer in answers:
        assert [float(v[0, 0]) for v in answer] == pytest.approx(expected, rel=1e-6)


def test_a_minimum_that_is_not_enclosed_is_said(
    flow: Flow, runs: LawRuns, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulator_fit, "ROUNDS", 1)
    found = fit(flow, runs, (0.25, 0.9))
    assert not found.inside
    assert "NOT a minimum" in str(found)


@pytest.mark.long
def test_I0_is_found_from_a_wrong_one(flow: Flow) -> None:
    """mu_2 and I0 move together; the slope at small I is what is known best."""
    found = fit(flow, law_runs_of(flow, 0.22, free_I0=True), (0.41, 0.68))
    assert found.inside
    assert found.I0 is not None
    assert found.I0_std is not None
    assert found.correlation is not None
    assert found.correlation > 0.8
    assert abs(found.mu_s / LAW[0] - 1) < 0.005
    assert abs(found.mu_2 / LAW[1] - 1) < 0.02
    assert abs(found.I0 / 0.3 - 1) < 0.05
    slope = (found.mu_2 - found.mu_s) / found.I0
    assert abs(slope / ((LAW[1] - LAW[0]) / 0.3) - 1) < 0.02
    assert f"I0 {found.I0:.4f}" in str(found)
    assert "correlation of mu_2 with I0 +" in str(found)
    assert decode(SimulatorFit, json.loads(json.dumps(dataclasses.asdict(found)))) == found
