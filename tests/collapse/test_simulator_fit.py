"""The fit of the simulator finds the law of its own runs, and errs as much as it says."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from granpinn.data import Flow, add_noise
from granpinn.identification import simulator_fit
from granpinn.identification.resimulation import Column, initial_column
from granpinn.identification.simulator_fit import SPACING, Simulations, fit, law_at
from granpinn.results.decoding import decode
from granpinn.results.findings import Resimulation
from granpinn.simulation import Collapse, simulate

LAW = (0.4, 0.64)


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(*LAW, cells=64, stride=2, frames=20, t_end=3.0, threads=1))


@pytest.fixture(scope="module")
def simulations(flow: Flow) -> Simulations:
    column = initial_column(flow)
    assert isinstance(column, Column)
    return Simulations(flow, column, 0.3)


def test_it_finds_the_law_of_its_own_run(flow: Flow, simulations: Simulations) -> None:
    found = fit(flow, simulations, (0.41, 0.68))
    assert found.inside
    assert found.cells == 64
    assert abs(found.mu_s / LAW[0] - 1) < 0.005
    assert abs(found.mu_2 / LAW[1] - 1) < 0.01
    assert found.misfit_percent < 1


def test_a_far_start_ends_in_the_same_place(flow: Flow, simulations: Simulations) -> None:
    near, far = fit(flow, simulations, (0.41, 0.68)), fit(flow, simulations, (0.25, 0.9))
    assert far.inside
    assert far.mu_s == pytest.approx(near.mu_s, rel=0.003)
    assert far.mu_2 == pytest.approx(near.mu_2, rel=0.01)


def test_its_scatter_over_noise_is_the_stated_one(flow: Flow, simulations: Simulations) -> None:
    clean = fit(flow, simulations, (0.41, 0.68))
    draws = [fit(add_noise(flow, 0.03, seed), simulations, (0.41, 0.68)) for seed in range(24)]
    for name, k in (("mu_s", 0), ("mu_2", 1)):
        pulls = [(getattr(f, name) - getattr(clean, name)) / f.std[k] for f in draws]
        assert 0.65 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.5  # 24 draws: 1 +- 0.15


def test_runs_are_made_once(flow: Flow, simulations: Simulations) -> None:
    fit(flow, simulations, (0.41, 0.68))
    before = simulations.runs
    fit(flow, simulations, (0.41, 0.68))
    assert simulations.runs == before


def test_a_minimum_that_is_not_enclosed_is_said(
    flow: Flow, simulations: Simulations, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulator_fit, "ROUNDS", 1)
    found = fit(flow, simulations, (0.25, 0.9))
    assert not found.inside
    assert "NOT a minimum" in str(found)


def test_the_record_survives_results_json(flow: Flow, simulations: Simulations) -> None:
    found = fit(flow, simulations, (0.41, 0.68))
    record = Resimulation(None, 64, (1.0, 10.0), fit=found)
    assert decode(Resimulation, json.loads(json.dumps(dataclasses.asdict(record)))) == record


def test_the_lattice_of_laws() -> None:
    mu_s, mu_2 = law_at(np.array([-30, -10]) * SPACING)
    assert 0 < mu_s < mu_2
