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
from granpinn.checks.simulator_fit import NARROWEST, SimulatorFit, asked_for, fit, products
from granpinn.data import Flow, add_noise
from granpinn.physics.laws import DEFAULT
from granpinn.results.decoding import decode
from granpinn.simulation import Collapse, law_runs, simulate
from granpinn.simulation.law_runs import LawRuns, velocity_at
from granpinn.simulation.likeness import GrainColumn, initial_column, interpolation

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


def test_a_far_start_ends_in_the_same_place(flow: Flow, runs: LawRuns) -> None:
    near, far = fit(flow, runs, (0.41, 0.68)), fit(flow, runs, (0.25, 0.9))
    assert far.inside
    assert far.mu_s == pytest.approx(near.mu_s, rel=0.003)
    assert far.mu_2 == pytest.approx(near.mu_2, rel=0.01)


def test_its_scatter_over_noise_is_the_stated_one(flow: Flow, runs: LawRuns) -> None:
    clean = fit(flow, runs, (0.41, 0.68))
    draws = [fit(add_noise(flow, 0.03, seed), runs, (0.41, 0.68)) for seed in range(24)]
    for name, k in (("mu_s", 0), ("mu_2", 1)):
        pulls = [(getattr(f, name) - getattr(clean, name)) / f.std[k] for f in draws]
        assert 0.65 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.5  # 24 draws: 1 +- 0.15


def test_nodes_are_as_far_apart_as_noise_asks_for(flow: Flow, runs: LawRuns) -> None:
    """With so much noise the nodes of quiet data would not enclose what is left open."""
    narrowest, widest = NARROWEST, simulator_fit.WIDEST
    np.testing.assert_array_equal(
        asked_for(np.array([0.1, 4.0, 4.1, 100.0]), np.full(4, narrowest)),
        [narrowest, 4, 8, widest],
    )
    data = [add_noise(flow, 0.1, seed) for seed in range(8)]
    assert all(fit(noisy, runs, (0.41, 0.68)).inside for noisy in data)
    wide = {node for _, node in runs._found}
    quiet = law_runs_of(flow, 0.3)
    fit(flow, quiet, (0.41, 0.68))
    span = [np.ptp([node[1] for node in nodes]) for nodes in (wide, {n for _, n in quiet._found})]
    assert span[0] > 2 * span[1]


def test_runs_are_made_once(flow: Flow, runs: LawRuns) -> None:
    fit(flow, runs, (0.41, 0.68))
    before = runs.made
    fit(flow, runs, (0.41, 0.68))
    assert runs.made == before


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


def test_the_record_survives_results_json(flow: Flow, runs: LawRuns) -> None:
    found = fit(flow, runs, (0.41, 0.68))
    assert decode(SimulatorFit, json.loads(json.dumps(dataclasses.asdict(found)))) == found


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


def test_the_last_search_is_on_the_cells_of_the_data(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(law_runs, "COARSE_CELLS", 48)
    runs = law_runs_of(flow, 0.3)
    assert runs.stages == [(48, 2), (64, 2)]
    assert law_runs_of(flow, 0.3, 56, True).stages == [(48, 2), (56, 3)]
    found = fit(flow, runs, (0.3, 0.8))
    assert found.cells == 64
    assert found.inside
    assert abs(found.mu_s / LAW[0] - 1) < 0.005
    assert abs(found.mu_2 / LAW[1] - 1) < 0.01


def test_what_is_taken_of_a_run_is_what_a_recorder_keeps(flow: Flow) -> None:
    column = initial_column(flow)
    assert isinstance(column, GrainColumn)
    collapse = law_runs.collapse_of(flow, column, DEFAULT, (*LAW, 0.3), 56)
    points = np.flatnonzero(flow.valid)[::7]
    taken = velocity_at(collapse, flow, points)
    whole = simulate(collapse)
    at = interpolation(whole, flow)
    expected = np.stack([[at(frame) for frame in field] for field in (whole.u, whole.v)])
    # The recorder rounds to float32 before the interpolation.
    np.testing.assert_allclose(taken, expected.reshape(2, -1)[:, points], rtol=1e-5, atol=1e-6)


def test_products_are_over_the_points_that_all_have(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulator_fit, "CHUNK", 7)
    v = np.random.default_rng(seed).normal(size=(4, 2, 30)).astype(np.float32)
    v[1, 0, 3] = v[3, 1, 20] = np.nan
    S, energy, common = products([*v[:3]], v[3])
    kept = np.delete(v.astype(np.float64), [3, 20], axis=2)
    misfits = (kept[:3] - kept[3]).reshape(3, -1)
    np.testing.assert_allclose(S, misfits @ misfits.T)
    assert energy == pytest.approx((kept[3] ** 2).sum())
    assert common == pytest.approx(28 / 30)


def test_the_lattice_of_laws(runs: LawRuns) -> None:
    q = np.array([-1.0, -1.5, 0.2])
    mu_s, mu_2, I0 = runs.law_at(q)
    assert 0 < mu_s < mu_2
    assert runs.law_at(q[:2])[2] == 0.3
    assert (mu_2 - mu_s) / I0 == pytest.approx(
        (runs.law_at(q[:2])[1] - mu_s) / 0.3
    )  # the slope is an axis
    h = 1e-6
    for k, one in enumerate(np.eye(3)):
        change = (np.array(runs.law_at(q + h * one)) - np.array(runs.law_at(q - h * one))) / (2 * h)
        np.testing.assert_allclose(runs.law_by_q(q)[:, k], change, atol=1e-8)
