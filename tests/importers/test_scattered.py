"""Conversion of scattered vectors of simulations and tables to a particle file."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, read

MATERIAL: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1"}
RNG = np.random.default_rng(3)
N = 600
T, X, Y = np.repeat([0.5, 1.0, 1.5], N // 3), RNG.uniform(0, 4, N), RNG.uniform(0, 3, N)


def arrays(**changes: Any) -> dict[str, Any]:
    return {"t": T, "x": X, "y": Y, "u": 1 + X, "v": -1 - Y, **changes}


def test_standard_deviations_go_with_their_vectors() -> None:
    """Where a vector has none it counts as little as the worst one."""
    sigma = 0.1 + 0.01 * np.arange(N)
    holes = np.where(np.arange(N) % 7 == 0, np.nan, sigma)
    u = np.where(np.arange(N) == 5, np.nan, 1 + X)
    flow = read(arrays(u=u, sigma_u=holes, sigma_v=sigma), surface="none", **MATERIAL)
    assert flow.particles is not None
    kept = np.arange(N) != 5
    worst = np.nanmax(holes)
    expected = np.where(np.isnan(holes), worst, holes)[kept]
    np.testing.assert_allclose(flow.particles.sigma_u, expected, rtol=1e-6)
    one = read(arrays(), surface="none", sigma="0.2", **MATERIAL)
    assert one.particles is not None
    assert one.particles.sigma_u is None
    assert one.sigma_v == 0.2


@pytest.mark.parametrize(
    ("change", "settings", "message"),
    [
        ({"u": np.full(N, np.nan)}, {}, "must hold measured vectors"),
        ({}, {"mask": "m.png"}, "mask is for vectors on a grid, got scattered ones"),
        ({}, {"sigma": "-1"}, "sigma must be positive"),
        ({"sigma_u": np.full(N, -0.1), "sigma_v": np.ones(N)}, {}, "sigma_u must be positive, and"),
        ({"sigma_u": np.ones(N), "sigma_v": np.full(N, np.inf)}, {}, "sigma_v must be positive"),
        ({}, {"sigma": "much"}, "sigma with dimensionless must be a finite number"),
        ({}, {"times": "name"}, "times name needs files, got arrays"),
        ({}, {"frames": "0:9:0"}, "frames must be FIRST:LAST:STEP"),
        ({"length_unit": "mm"}, {}, "dimensionless contradicts the files"),
    ],
)
def test_wrong_input_is_refused(
    change: dict[str, Any], settings: dict[str, Any], message: str
) -> None:
    settings = {"surface": "none", **settings, **MATERIAL}
    with pytest.raises(DataFileError, match=message):
        read(arrays(**change), **settings)
