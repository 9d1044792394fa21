"""The curve of a law over the I of the data, its 90 % band, and the points behind it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from granpinn.physics.laws import LAWS
from granpinn.results import (
    Covariance,
    IdentifiedLaw,
    read_results,
    write_results,
)
from granpinn.results.records import ErrorBars
from granpinn.uncertainty.determined import POINTS, stress_points, with_curve
from tests.examples import make_result

Array = npt.NDArray[np.floating]


HALF = 1.645


MU_OF_I = LAWS["mu_of_i"]


MATRIX = np.array([[1.6e-4, -6e-5], [-6e-5, 9e-4]])


def covariance(matrix: Array, *names: str) -> Covariance:
    return Covariance(names or ("mu_s", "mu_2"), tuple(map(tuple, matrix.tolist())))


def spread_of(low: float, high: float) -> Array:
    return np.geomspace(low, high, 2001)


@pytest.mark.parametrize("half", [HALF, 3.2])
def test_the_band_is_that_of_a_line_through_both_parameters(half: float) -> None:
    """sd(mu) = sqrt(J C J^T), by hand; symmetric in log mu."""
    bars = ErrorBars((0.01, 0.02), 8.0, half, "a test")
    result = make_result(covariance=covariance(MATRIX), error_bars=bars)
    curve = with_curve(result, (0.003, 0.5)).law.curve
    assert curve is not None
    mu_s, mu_2, I0 = result.theta
    x = np.array(curve.I) / (np.array(curve.I) + I0)
    J = np.stack([1 - x, x], axis=1)
    reach = half * np.sqrt(np.einsum("ni,ij,nj->n", J, MATRIX, J)) / curve.mu
    np.testing.assert_allclose(curve.mu, J @ [mu_s, mu_2])
    np.testing.assert_allclose(curve.low, curve.mu * np.exp(-reach))
    np.testing.assert_allclose(curve.high, curve.mu * np.exp(reach))


def test_the_curve_covers_the_range_that_the_data_determine() -> None:
    result = make_result()
    law = with_curve(result, (1e-3, 1.0)).law
    assert law.curve is not None
    assert law.I_range is not None
    I = np.array(law.curve.I)
    assert (len(I), I[0], I[-1]) == (POINTS, *law.I_range)
    np.testing.assert_allclose(np.diff(np.log(I)), np.log(I[-1] / I[0]) / (POINTS - 1))
    np.testing.assert_allclose(law.curve.mu, MU_OF_I.friction(I, *result.theta))
    assert (law.name, law.reason, law.points) == ("mu_of_i", None, None)


def test_the_band_is_as_wide_as_the_intervals() -> None:
    bars = ErrorBars((0.01, 0.02), 8.0, 3.29, "a test")
    widths = []
    for error_bars in (None, bars):
        result = make_result(covariance=covariance(MATRIX), error_bars=error_bars)
        curve = with_curve(result, (0.01, 0.3)).law.curve
        assert curve is not None
        assert curve.half_width is not None
        widths.append(curve.half_width)
    assert widths[1] / widths[0] == pytest.approx(2, rel=0.01)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"covariance": None, "law": IdentifiedLaw(reason="a reason")}, "a reason"),
        ({"covariance": None, "law": IdentifiedLaw()}, "the result has no error bars"),
        ({"covariance": covariance(1e6 * MATRIX)}, None),
    ],
)
def test_without_error_bars_the_band_is_not_determined(
    changes: dict[str, object], reason: str | None
) -> None:
    law = with_curve(make_result(**changes), (0.01, 0.3)).law
    assert law.curve is not None
    if reason is None:  # wide, but not without an end
        assert law.curve.low is not None
        assert min(law.curve.low) > 0
        return
    assert (law.curve.low, law.curve.high) == (None, None)
    assert law.reason is not None
    assert law.reason.endswith(reason)
    assert "; the error is not known: " in law.words


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
    result = with_curve(
        make_result(),
        (0.01, 0.3),
        stress_points(spread_of(0.01, 0.3), np.full(2001, 0.45), (0.01, 0.3)),
    )
    path = f"{tmp_path}/results.json"
    write_results(result, path)
    assert read_results(path) == result
    content = result.to_dict()["law"]
    assert list(content)[:3] == ["name", "I_range", "curve"]
    assert list(content["curve"]) == ["I", "mu", "low", "high"]
