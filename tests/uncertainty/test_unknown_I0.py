"""mu_s, the slope and I0 of mu(I) where I0 is not known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from granpinn.checks.profile_of_I0 import Profile
from granpinn.results import Covariance, Parameter, Parameters, Result
from granpinn.results.determined import Determined
from granpinn.results.records import ErrorBars
from granpinn.results.summary import NORMAL_90
from granpinn.uncertainty.error_model import ends_of, line
from granpinn.uncertainty.unknown_I0 import ProfilePoint, unknown_I0
from tests.examples import make_result

I_RANGE = (0.01, 0.2)
ENDS = np.array([0.42, 0.5])  # mu at the ends of the range, which all laws share
SD = np.array([0.004, 0.006])  # of these, independent
GIVEN = 0.3
GRID = (0.15, 0.3, 0.6)


def law(I0: float) -> tuple[float, float]:
    mu_s, mu_2 = np.linalg.solve(line(ends_of(I_RANGE, I0)), ENDS)
    return float(mu_s), float(mu_2)


def profile(excluded: tuple[bool, ...], best: float | None = None) -> Profile:
    points = []
    for I0, out in zip(GRID, excluded, strict=True):
        mu_s, mu_2 = law(I0)
        points.append(ProfilePoint(I0, mu_s, mu_2, (mu_2 - mu_s) / I0, 0.0, 0.0, out))
    bounds = (0.2, 0.4) if best else (None, None)
    return Profile(
        points=tuple(points),
        n_seeds=3,
        smallest_rise=1e-6,
        law_accuracy=0.005,
        I_low=0.0,
        I_high=0.2,
        best=best,
        allowed=bounds,
        slope=1.0,
        slope_std=0.0,
        correlation=None,
        mu_2_by_I0=1.0,
        status="separable" if best else "not separable",
        answer="",
    )


def with_unknown_I0(found: Profile, result: Result) -> Profile:
    unknown = unknown_I0(found.points, found.best, found.allowed, result)
    return dataclasses.replace(found, unknown=unknown)


def run() -> Result:
    """A run at GIVEN whose covariance is that of independent errors of mu at the ends."""
    mu_s, mu_2 = law(GIVEN)
    back = np.linalg.inv(line(ends_of(I_RANGE, GIVEN)))
    C = back @ np.diag(SD**2) @ back.T
    return make_result(
        parameters=Parameters(
            mu_s=Parameter(mu_s, False), mu_2=Parameter(mu_2, False), I0=Parameter(GIVEN, True)
        ),
        covariance=Covariance(("mu_s", "mu_2"), tuple(map(tuple, C.tolist()))),
        determined=Determined(*I_RANGE, 0.05, 0.44, None, None),
        error_bars=ErrorBars((0.0, 0.0), 50.0, NORMAL_90, "made up"),
    )


def test_one_value_of_I0_has_the_errors_of_the_run() -> None:
    found = with_unknown_I0(profile((True, False, True), best=0.31), run()).unknown
    assert found is not None
    mu_s, mu_2 = law(GIVEN)
    low, high = found.mu_s.interval_90 or (0, 0)
    covariance = run().covariance
    assert covariance is not None
    sd = math.sqrt(covariance.matrix[0][0])
    assert found.mu_s.value == pytest.approx(mu_s)
    assert math.log(high / low) / 2 == pytest.approx(NORMAL_90 * sd / mu_s, rel=1e-3)
    C = np.array(covariance.matrix)
    sd = math.sqrt(C[0, 0] + C[1, 1] - 2 * C[0, 1]) / GIVEN
    assert found.slope.value == pytest.approx((mu_2 - mu_s) / GIVEN)
    assert found.slope.std == pytest.approx(sd)
    assert found.I0.interval_90 == (0.2, 0.4)
    assert found.I0.value == 0.31


def test_mu_at_the_ends_is_as_well_known_for_every_I0() -> None:
    """A run at another I0 has other errors of mu_s and mu_2, and the same of mu at the ends."""
    found = [
        with_unknown_I0(profile((k != 0, k != 1, k != 2)), run()).unknown for k in range(len(GRID))
    ]
    for I0, unknown in zip(GRID, found, strict=True):
        assert unknown is not None
        back = np.linalg.inv(line(ends_of(I_RANGE, I0)))
        sd = math.sqrt((back @ np.diag(SD**2) @ back.T)[0, 0])
        assert unknown.mu_s.std == pytest.approx(sd, rel=1e-6)


def test_an_I0_that_is_not_separable_widens_the_intervals() -> None:
    one = with_unknown_I0(profile((True, False, True)), run()).unknown
    every = with_unknown_I0(profile((False, False, False)), run())
    found = every.unknown
    assert one is not None
    assert found is not None
    assert not found.I0.determined
    assert found.I0.interval_90 is None
    for name in ("mu_s", "slope"):
        low, high = found[name].interval_90 or (0, 0)
        least, most = one[name].interval_90 or (0, 0)
        assert high - low > 1.05 * (most - least)
        values = [getattr(point, name) for point in every.points]
        assert min(values) < found[name].value < max(values)
    assert "mu_s 0.4" in str(every)
    assert "I0 not determined" in str(every)


def test_a_mixture_holds_90_percent_of_its_draws() -> None:
    every = with_unknown_I0(profile((False, False, False)), run())
    assert every.unknown is not None
    draws = []
    generator = np.random.default_rng(0)
    for I0 in GRID:
        mu = ENDS + SD * generator.normal(size=(20_000, 2))
        mu_s, mu_2 = np.linalg.solve(line(ends_of(I_RANGE, I0)), mu.T)
        draws.append(np.stack([mu_s, (mu_2 - mu_s) / I0]))
    every_draw = np.concatenate(draws, axis=1)
    for name, values in zip(("mu_s", "slope"), every_draw, strict=True):
        low, high = every.unknown[name].interval_90 or (0, 0)
        assert np.mean(values < low) == pytest.approx(0.05, abs=0.005)
        assert np.mean(values > high) == pytest.approx(0.05, abs=0.005)
        assert every.unknown[name].std == pytest.approx(values.std(), rel=0.02)
