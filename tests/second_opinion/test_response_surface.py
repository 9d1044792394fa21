"""The surface is exact for quadratic values, and estimates the roughness of its runs."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.second_opinion.response_surface import REACH, ResponseSurface, composite


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_surface_is_exact_for_quadratic_values(dimension: int, seed: int) -> None:
    rng, places = np.random.default_rng(seed), composite(dimension)
    a, b = rng.normal(size=50), rng.normal(size=(dimension, 50))
    C = 0.1 * rng.normal(size=(dimension, dimension, 50))

    def v(x: np.ndarray) -> np.ndarray:
        return a + x @ b + np.einsum("i,ijn,j", x, C, x)

    surface, x = ResponseSurface(places), np.array([0.3, -0.7, 1.1])[:dimension]
    misfits = np.stack([v(np.array(place, float)) - v(x) for place in places])
    found = surface.nearest(misfits @ misfits.T, 50)
    np.testing.assert_allclose(found.x, x, atol=1e-6)
    assert abs(found.misfit) < 1e-9
    J = b + np.einsum("ijn,j->in", C + C.swapaxes(0, 1), x)
    slopes = misfits.T @ surface.slopes(x)
    np.testing.assert_allclose(slopes.T, J, atol=1e-9)
    beyond = np.stack([v(np.array(place, float)) - v(10 * x) for place in places])
    assert np.abs(surface.nearest(beyond @ beyond.T, 50).x).max() == REACH


def test_noise_alone_is_stated_as_it_scatters(seed: int) -> None:
    rng, surface = np.random.default_rng(seed), ResponseSurface(composite(2))
    b = rng.normal(size=(2, 400))
    v = np.array(composite(2)) @ b
    pulls = []
    for _ in range(60):
        misfits = v - (np.array([0.2, -0.3]) @ b + rng.normal(size=400))
        found = surface.nearest(misfits @ misfits.T, 400)
        assert found.roughness < 1e-9
        pulls.append((found.x - [0.2, -0.3]) / np.sqrt(np.diag(found.covariance)))
    assert 0.8 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.2  # 120 pulls: 1 +- 0.065
