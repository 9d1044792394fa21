"""The curve of a law over the I of the data, its 90 % band, and the points behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from granpinn.physics.laws import LAWS, Law
from granpinn.results import (
    Covariance,
    ErrorPercent,
    IdentifiedLaw,
    Parameter,
    Parameters,
    Result,
    read_results,
    results_csv,
    write_results,
)
from granpinn.results.determined import Determined
from granpinn.results.records import ErrorBars, Verdict
from granpinn.uncertainty.curve import POINTS, band, stress_points, with_curve
from granpinn.uncertainty.determined import determined
from tests.examples import make_result

Array = npt.NDArray[np.floating]
HALF = 1.645
MU_OF_I, COULOMB = LAWS["mu_of_i"], LAWS["coulomb"]
THETA = (0.4, 0.6, 0.3)
MATRIX = np.array([[1.6e-4, -6e-5], [-6e-5, 9e-4]])
WITHIN = 0.01  # of the width: error of the percentiles of the draws


def covariance(matrix: Array, *names: str) -> Covariance:
    return Covariance(names or ("mu_s", "mu_2"), tuple(map(tuple, matrix.tolist())))


def sd_of_mu(I: Array, matrix: Array) -> Array:  # noqa: E741
    """mu(I) is linear in mu_s and mu_2."""
    x = I / (I + THETA[2])
    J = np.stack([1 - x, x], axis=1)
    return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", J, matrix, J)))


def spread_of(low: float, high: float) -> Array:
    return np.geomspace(low, high, 2001)


# ---- the band ------------------------------------------------------------------------------------


@pytest.mark.parametrize("half", [HALF, 3.2])
def test_a_narrow_band_is_the_first_order_one(half: float, seed: int) -> None:
    I = spread_of(0.003, 0.5)  # noqa: E741
    ends = band(MU_OF_I, THETA, covariance(MATRIX), half, I, seed)
    assert ends is not None
    mu, width = MU_OF_I.friction(I, *THETA), half * sd_of_mu(I, MATRIX)
    np.testing.assert_allclose((mu - ends[0]) / width, 1, atol=2 * WITHIN)
    np.testing.assert_allclose((ends[1] - mu) / width, 1, atol=2 * WITHIN)


@pytest.mark.parametrize("law", LAWS.values(), ids=lambda law: law.name)
def test_the_band_of_every_law_is_the_first_order_one(law: Law, seed: int) -> None:
    """Independent parameters that are known to 2 %, against central differences."""
    I, theta = np.geomspace(0.004, 0.3, 80), np.array(law.complete([None] * len(law.names)))  # noqa: E741
    places = [law.names.index(name) for name in law.free]
    sd, step = 0.02 * theta[places], 1e-5 * theta
    unit = np.eye(theta.size)[places]
    J = [
        (law.friction(I, *(theta + step * e)) - law.friction(I, *(theta - step * e))) / (2e-5 * t)
        for e, t in zip(unit, theta[places], strict=True)
    ]
    known = covariance(np.diag(sd**2), *law.free)
    ends = band(law, tuple(theta.tolist()), known, HALF, I, seed)
    assert ends is not None
    mu, width = law.friction(I, *theta), HALF * np.sqrt(sd**2 @ np.square(J))
    np.testing.assert_allclose((mu - ends[0]) / width, 1, atol=3 * WITHIN)
    np.testing.assert_allclose((ends[1] - mu) / width, 1, atol=3 * WITHIN)


def test_the_band_of_constant_friction_is_the_interval_of_its_parameter(seed: int) -> None:
    I = spread_of(0.003, 0.5)  # noqa: E741
    known = covariance(np.array([[1e-4]]), "mu_s")
    ends = band(COULOMB, (0.4,), known, 2.0, I, seed)
    assert ends is not None
    np.testing.assert_allclose(ends[0], 0.38, atol=2 * WITHIN * 0.02)
    np.testing.assert_allclose(ends[1], 0.42, atol=2 * WITHIN * 0.02)


def test_a_wide_band_stays_inside_the_admissible_set(seed: int) -> None:
    """Against many draws of another generator, without mu_s < 0 and mu_2 < mu_s."""
    I = spread_of(0.003, 0.5)  # noqa: E741
    matrix = 900 * MATRIX
    ends = band(MU_OF_I, THETA, covariance(matrix), HALF, I, seed)
    assert ends is not None
    drawn = np.random.default_rng(seed).multivariate_normal(THETA[:2], matrix, 100_000)
    drawn = drawn[(drawn[:, 0] > 0) & (drawn[:, 1] > drawn[:, 0])]
    for k in (0, 1000, 2000):
        x = I[k] / (I[k] + THETA[2])
        exact = np.quantile(drawn @ np.array([1 - x, x]), (0.05, 0.95))
        width = np.diff(exact)[0]
        assert (ends[0][k], ends[1][k]) == pytest.approx(exact, abs=2 * WITHIN * width)
    first_order = THETA[0] - HALF * sd_of_mu(I[:1], matrix)[0]
    assert first_order < 0 < ends[0][0]


def test_the_band_holds_the_true_curve_in_nine_of_ten_cases(seed: int) -> None:
    """Estimates scatter around the truth with their covariance, for every law at every I."""
    I, cases = np.array([0.004, 0.05, 0.4]), 250  # noqa: E741
    deviation = 3.5 * math.sqrt(0.09 / cases) + WITHIN
    for law, theta, matrix in (
        (MU_OF_I, THETA, 4 * MATRIX),
        (COULOMB, (0.4,), np.array([[1e-3]])),
    ):
        n = len(matrix)
        known = covariance(matrix, *law.names[:n])
        drawn = np.random.default_rng(seed).multivariate_normal(theta[:n], matrix, cases)
        held = np.zeros(I.size)
        for row in drawn.tolist():
            ends = band(law, (*row, *theta[n:]), known, HALF, I, seed)
            assert ends is not None
            true = law.friction(I, *theta)
            held += (ends[0] <= true) & (true <= ends[1])
        np.testing.assert_allclose(held / cases, 0.9, atol=deviation)


def test_parameters_that_a_law_cannot_have_leave_no_band(seed: int) -> None:
    outside = band(COULOMB, (-1.0,), covariance(np.array([[1e-4]]), "mu_s"), HALF, np.ones(2), seed)
    assert outside is None


def test_the_draws_are_a_function_of_the_seed(seed: int) -> None:
    I = spread_of(0.003, 0.5)  # noqa: E741
    one, two, other = (
        band(MU_OF_I, THETA, covariance(MATRIX), HALF, I, s) for s in (seed, seed, seed + 1)
    )
    assert np.array_equal(np.array(one), np.array(two))
    assert not np.array_equal(np.array(one), np.array(other))


# ---- the record ----------------------------------------------------------------------------------


def test_the_curve_covers_the_range_that_the_data_determine() -> None:
    number, weight = spread_of(1e-3, 1.0), np.linspace(0, 1, 2001)
    result = make_result()
    law, shear = with_curve(result, number, weight).law, determined(result, number, weight)
    assert shear is not None
    assert law.curve is not None
    assert law.I_range == (shear.I_low, shear.I_high)
    I = np.array(law.curve.I)  # noqa: E741
    assert (len(I), I[0], I[-1]) == (POINTS, shear.I_low, shear.I_high)
    np.testing.assert_allclose(np.diff(np.log(I)), np.log(I[-1] / I[0]) / (POINTS - 1))
    np.testing.assert_allclose(law.curve.mu, MU_OF_I.friction(I, *result.theta))
    assert (law.name, law.reason, law.points) == ("mu_of_i", None, None)


def test_the_band_is_as_wide_as_the_intervals() -> None:
    bars = ErrorBars((0.01, 0.02), (0.01, 0.02), (5.0, 6.0), (2.0, 3.29), "a test", False)
    widths = []
    for error_bars in (None, bars):
        result = make_result(covariance=covariance(MATRIX), error_bars=error_bars)
        curve = with_curve(result, spread_of(0.01, 0.3), np.ones(2001)).law.curve
        assert curve is not None
        assert curve.half_width is not None
        widths.append(curve.half_width)
    assert widths[1] / widths[0] == pytest.approx(2, rel=0.01)


def test_one_inertial_number_gives_one_friction() -> None:
    law = with_curve(make_result(), np.full(50, 0.1), np.ones(50), np.full(50, 0.45)).law
    assert law.I_range == (0.1, 0.1)
    assert law.curve is not None
    assert set(law.curve.I) == {0.1}
    assert law.points is not None
    assert (law.points.I, law.points.mu, law.points.count) == ((0.1,), (0.45,), (50,))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"covariance": None, "verdict": Verdict(None, "no error bars: a reason")}, "a reason"),
        ({"covariance": None, "verdict": None}, "the result has no error bars"),
        ({"covariance": covariance(1e6 * MATRIX)}, None),
    ],
)
def test_without_error_bars_the_band_is_not_determined(
    changes: dict[str, object], reason: str | None
) -> None:
    law = with_curve(make_result(**changes), spread_of(0.01, 0.3), np.ones(2001)).law
    assert law.curve is not None
    if reason is None:  # wide, but not without an end
        assert law.curve.low is not None
        assert min(law.curve.low) > 0
        return
    assert (law.curve.low, law.curve.high) == (None, None)
    assert law.reason is not None
    assert law.reason.endswith(reason)
    assert str(law).endswith("90 % band not determined")


def test_without_a_meaning_there_is_no_curve() -> None:
    nothing = Determined(0.0, 0.1, 0.05, 0.4, None, None, {}, ("mu_s", "mu_2"), reason="walls move")
    made = with_curve(make_result(determined=nothing), spread_of(0.01, 0.3), np.ones(2001))
    assert made.law.curve is None
    assert str(made.law).endswith("not determined: walls move")
    row = results_csv.row(made)
    assert [row[f"mu_at_I_{place}"] for place in results_csv.PLACES] == ["not determined"] * 3
    assert row["I_low"] is None


def test_grains_at_rest_have_no_range() -> None:
    made = with_curve(make_result(), np.zeros(5), np.ones(5))
    assert made.law == IdentifiedLaw("mu_of_i", reason="no grains shear")
    assert results_csv.row(made)["mu_at_I_low"] is None


def test_the_points_are_medians_with_16_to_84_percent() -> None:
    """Ratios 0 to 100 in every bin: percentiles are their own numbers."""
    edges = np.geomspace(0.01, 1.0, 21)
    middles = np.sqrt(edges[:-1] * edges[1:])
    number = np.repeat(middles, 101)
    ratio = np.tile(np.arange(101.0), 20)
    few = np.append(np.full(19, 0.0101), [5.0, 1e-3])  # few in a bin, and outside of the range
    found = stress_points(
        np.append(number[101:], few), np.append(ratio[101:], np.ones(21)), (0.01, 1.0)
    )
    assert found is not None
    np.testing.assert_allclose(found.I, middles[1:])
    for values, expected in ((found.low, 16), (found.mu, 50), (found.high, 84)):
        np.testing.assert_allclose(values, expected)
    assert set(found.count) == {101}
    assert stress_points(number, np.full(2020, np.nan), (0.01, 1.0)) is None


def test_the_record_in_the_files(tmp_path: object) -> None:
    result = with_curve(make_result(), spread_of(0.01, 0.3), np.ones(2001), np.full(2001, 0.45))
    path = f"{tmp_path}/results.json"
    write_results(result, path)
    assert read_results(path) == result
    content = result.to_dict()["law"]
    assert list(content)[:3] == ["name", "I_range", "curve"]
    assert list(content["curve"]) == ["I", "mu", "low", "high"]
    row, curve = results_csv.row(result), result.law.curve
    assert curve is not None
    assert curve.low is not None
    assert curve.high is not None
    assert (row["I_low"], row["I_high"]) == result.law.I_range
    for place, k in (("low", 0), ("middle", 40), ("high", 79)):
        assert row[f"I_{place}"] == curve.I[k]
        assert row[f"mu_at_I_{place}"] == curve.mu[k]
        ends = row[f"mu_at_I_{place}_low_90"], row[f"mu_at_I_{place}_high_90"]
        assert ends == (curve.low[k], curve.high[k])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"mu": [0.4]}, "equally many values"),
        ({"low": None}, "two lists, or both null"),
        ({"I": [0.2, 0.045, 0.01]}, "positive and ascending"),
        ({"I": [0.0, 0.045, 0.2]}, "positive and ascending"),
        ({"mu": [0.5, 0.44, 0.49]}, "mu must be from low to high, got 0.4, 0.5, 0.44 at I = 0.01"),
    ],
)
def test_a_record_that_contradicts_itself_is_refused(
    change: dict[str, object], sentence: str
) -> None:
    curve = make_result().law.curve
    assert curve is not None
    values = {k: None if v is None else tuple(v) for k, v in change.items()}  # type: ignore[call-overload]
    with pytest.raises(ValueError, match=sentence):
        replace(curve, **values)


def test_the_curve_of_coulomb_is_flat() -> None:
    result: Result = make_result(
        law=IdentifiedLaw("coulomb"),
        parameters=Parameters(mu_s=Parameter(0.33, fixed=False)),
        covariance=None,
        members=None,
        error_percent=ErrorPercent(),
    )
    curve = with_curve(result, spread_of(0.01, 0.3), np.ones(2001)).law.curve
    assert curve is not None
    assert set(curve.mu) == {0.33}
