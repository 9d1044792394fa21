"""The yardsticks of the studies: exact parts, and the law of a flow with known parameters."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.studies.draws import with_bounds
from bench.studies.regression.run import identify, smooth
from bench.studies.simulator_fit.bound import bound, sensitivities
from bench.studies.simulator_fit.run import fit_draws
from granpinn.data import read_flow, write_flow
from granpinn.fit.scoring import difference
from granpinn.simulation import Collapse, demo_path, simulate


def test_derivatives_of_a_plane_are_exact_up_to_its_edges() -> None:
    t, y, x = np.meshgrid(np.arange(3.0), 0.5 * np.arange(5), 0.1 * np.arange(6), indexing="ij")
    f = 1 + 2 * t - 3 * y + 4 * x
    f[1, 2, 3] = np.nan
    for axis, (spacing, slope) in enumerate(((1.0, 2.0), (0.5, -3.0), (0.1, 4.0))):
        found = difference(f, spacing, axis)
        np.testing.assert_allclose(found[np.isfinite(found)], slope)
        assert np.isfinite(found).sum() >= f.size - 3  # a hole and its neighbours


def test_smoothing_keeps_a_constant_beside_holes() -> None:
    f = np.full((4, 9, 9), 2.0)
    f[:, 3:5, 3:5] = np.nan
    found = smooth(f, 1.5)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(f))
    np.testing.assert_allclose(found[np.isfinite(found)], 2.0)


def test_regression_with_the_true_pressure_finds_the_law() -> None:
    row = identify(read_flow(demo_path()), 0.0, with_pressure=True)
    assert abs(row["error_mu_s_percent"]) < 2
    assert abs(row["error_mu_2_percent"]) < 10


def test_the_simulator_is_fitted_to_its_own_run(tmp_path: Path) -> None:
    """No model error: the truth is the least misfit, and it is reached from far away."""
    flow = simulate(Collapse(0.4, 0.64, cells=64, stride=1, frames=24, t_end=4.0, threads=1))
    write_flow(flow, tmp_path / "own.h5")
    clean, noisy = fit_draws(tmp_path / "own.h5", (0.0, 0.05), 2, 0, 64)
    assert clean["inside"] == 2
    assert clean["draws_percent"][0] == clean["draws_percent"][1]
    assert clean["errors_percent"]["mu_s"]["rmse"] < 0.5
    assert clean["errors_percent"]["mu_2"]["rmse"] < 2
    assert noisy["misfit_percent"] > clean["misfit_percent"]
    assert noisy["draws_percent"][0] != noisy["draws_percent"][1]


def test_errors_stand_beside_the_bound_of_their_law() -> None:
    grid = {"mu_s_percent": 0.1, "mu_2_percent": 0.2}
    grid["joint_percent"] = {"mu_s": 0.3, "mu_2": 0.4, "I0": 1.0}
    known = {"mu_s": 0.4, "mu_2": 0.64, "noise": 0.1, "points": 400, "one_grid": grid}
    row = {"mu_s": 0.4, "mu_2": 0.64, "noise": 0.2, "points": 100}
    rmse = {"mu_s": {"rmse": 0.8}, "mu_2": {"rmse": 0.8}}
    (two,) = with_bounds([row | {"errors_percent": rmse}], [known])
    assert two["rmse_over_bound"] == pytest.approx({"mu_s": 2, "mu_2": 1})
    (three,) = with_bounds([row | {"errors_percent": rmse | {"I0": {"rmse": 4}}}], [known])
    assert three["rmse_over_bound"] == pytest.approx({"mu_s": 0.8 / 1.2, "mu_2": 0.5, "I0": 1})


def test_the_bound_scales_as_it_must() -> None:
    collapse = Collapse(0.4, 0.64, cells=64, stride=1, frames=8, t_end=4.0, threads=1)
    J, speed = sensitivities(collapse, 0.02)
    assert J.shape[:2] == (2, 2)
    one = bound(J, speed, 1000, 0.1)
    double, four = bound(J, speed, 1000, 0.2), bound(J, speed, 4000, 0.1)
    for grids in ("one_grid", "two_grids"):
        for name in ("mu_s_percent", "mu_2_percent"):
            sd = one[grids][name]
            assert math.isclose(double[grids][name], 2 * sd)
            assert math.isclose(four[grids][name], sd / 2)
            assert one["one_grid"][name] <= sd
            assert one["one_grid"]["joint_percent"][name[:4]] >= one["one_grid"][name]
    rng = np.random.default_rng(0)
    white = rng.normal(size=(2, 50000, 3))
    ideal = bound(np.stack([white, white]), 1.0, 50000, 0.1)
    assert ideal["two_grids"]["mu_s_percent"] == pytest.approx(
        100 * 0.1 / math.sqrt(2 * 50000), rel=0.02
    )
