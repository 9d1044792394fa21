"""The yardsticks of the studies: exact parts, and the law of a flow with known parameters."""

from __future__ import annotations

import numpy as np

from bench.studies.regression.run import identify, smooth
from granpinn.data import read_flow
from granpinn.fit.scoring import difference
from granpinn.simulation import demo_path


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
