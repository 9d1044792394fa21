"""Noise has the given standard deviation, is white, and is a function of the seed alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, add_noise, check_flow, known_sd
from granpinn.data.noise import max_speed
from tests.flows import make_flow

FLOW = make_flow(frames=20, rows=48, columns=40)  # about 8,800 vectors


def added(noisy: Flow) -> np.ndarray:
    """The noise on (u, v) where there are vectors, [2, N]."""
    valid = FLOW.valid
    return np.stack([noisy.u[valid] - FLOW.u[valid], noisy.v[valid] - FLOW.v[valid]])


@pytest.mark.parametrize("sd", [0.02, 0.2, 0.8])
def test_has_the_size_it_says(sd: float) -> None:
    noise = added(add_noise(FLOW, sd, seed=1))
    n = noise.size
    assert noise.std() == pytest.approx(sd * max_speed(FLOW), rel=4 / np.sqrt(2 * n))
    assert abs(noise.mean()) < 4 * sd * max_speed(FLOW) / np.sqrt(n)


def test_is_white() -> None:
    """No correlation between u and v, nor between neighbors."""
    noise = added(add_noise(FLOW, 0.2, seed=2))
    bound = 4 / np.sqrt(noise.shape[1])
    assert abs(np.corrcoef(noise)[0, 1]) < bound
    assert abs(np.corrcoef(noise[0, 1:], noise[0, :-1])[0, 1]) < bound


def test_is_a_function_of_the_seed() -> None:
    one, same, other = (add_noise(FLOW, 0.2, seed) for seed in (7, 7, 8))
    assert one.u.tobytes() == same.u.tobytes()
    assert one.v.tobytes() == same.v.tobytes()
    assert abs(np.corrcoef(added(one)[0], added(other)[0])[0, 1]) < 0.05
    np.testing.assert_allclose(
        add_noise(FLOW, 0.1, 7).u - FLOW.u, (one.u - FLOW.u) / 2, atol=1e-6, equal_nan=True
    )


def test_nan_stays_and_the_flow_still_keeps_the_rules() -> None:
    noisy = add_noise(FLOW, 0.2, seed=4)
    np.testing.assert_array_equal(np.isnan(noisy.u), np.isnan(FLOW.u))
    assert noisy.u.dtype == np.float32
    assert noisy.truth == FLOW.truth
    assert noisy.p is FLOW.p
    check_flow(noisy)


def test_sigma_is_combined_in_quadrature() -> None:
    added_sigma = 0.2 * max_speed(FLOW)
    assert add_noise(FLOW, 0.2, 0).sigma_u == added_sigma
    known = add_noise(replace(FLOW, sigma_u=1.0, sigma_v=2.0), 0.2, 0)
    assert known.sigma_v == pytest.approx(np.hypot(2.0, added_sigma))
    field = np.where(FLOW.material, 1.0, np.nan).astype(np.float32)
    fields = add_noise(replace(FLOW, sigma_u=field, sigma_v=field), 0.2, 0)
    assert isinstance(fields.sigma_u, np.ndarray)
    np.testing.assert_allclose(fields.sigma_u[FLOW.material], np.hypot(1.0, added_sigma), rtol=1e-6)
    assert np.isnan(fields.sigma_u[~FLOW.material]).all()


def test_surface_pressure_gets_noise_relative_to_its_own_size() -> None:
    surface = FLOW.surface
    assert surface is not None
    assert surface.p is not None
    loaded = replace(FLOW, surface=replace(surface, p=np.full_like(surface.p, -300.0)))
    noisy = add_noise(loaded, 0.1, seed=5).surface
    assert noisy is not None
    assert noisy.p is not None
    np.testing.assert_array_equal(noisy.x, surface.x)
    assert np.std(noisy.p) == pytest.approx(30, rel=4 / np.sqrt(2 * len(noisy.p)))
    no_pressure = add_noise(replace(FLOW, surface=replace(surface, p=None)), 0.1, 5).surface
    assert no_pressure is not None
    assert no_pressure.p is None


def test_known_noise_is_the_mean_over_both_components() -> None:
    assert known_sd(replace(FLOW, sigma_u=0.3, sigma_v=0.3)) == pytest.approx(0.3)
    assert known_sd(replace(FLOW, sigma_u=0.1, sigma_v=0.7)) == pytest.approx(0.5)
    of_each = np.where(FLOW.valid, 0.2, 9.0).astype(np.float32)  # nothing is known outside
    assert known_sd(replace(FLOW, sigma_u=of_each, sigma_v=of_each)) == pytest.approx(0.2)
    assert known_sd(replace(FLOW, sigma_u=None, sigma_v=None)) == 0
