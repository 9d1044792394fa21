"""Local fits: exact fields, the noise of slopes, and slopes along a line as SciPy's."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from granpinn.estimates.local_fits import line_slopes, local_fits

WINDOW = 7


@pytest.mark.parametrize("order", [1, 2])
def test_a_polynomial_of_the_order_is_exact_beside_gaps_and_edges(order: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, y, x = np.meshgrid(0.5 * np.arange(6), 2.0 * np.arange(8), np.arange(9.0), indexing="ij")
    field = 1 + t - 2 * y + 3 * x + (order == 2) * (t * y - 0.2 * x**2 + y * y)
    slopes = {
        0: 1 + (order == 2) * y,
        1: -2 + (order == 2) * (t + 2 * y),
        2: 3 - (order == 2) * 0.4 * x,
    }
    weight = (rng.random(field.shape) > 0.2) * rng.integers(1, 4, field.shape).astype(float)
    found = local_fits([field * (weight > 0)], weight, (0.5, 2.0, 1.0), (2, 2, 2), order)
    assert len(found.value) > 0.9 * np.count_nonzero(weight)
    np.testing.assert_allclose(found.value[:, 0], field[found.index], rtol=1e-9, atol=1e-8)
    for axis, expected in slopes.items():
        own = np.broadcast_to(expected, field.shape)[found.index]
        np.testing.assert_allclose(found.slopes[:, axis, 0], own, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("order", [1, 2])
def test_the_stated_errors_are_those_of_noise(order: int, seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal((9, 40, 40))
    found = local_fits([noise], np.ones_like(noise), (0.5, 2.0, 1.0), (2, 2, 1), order)
    scatter = found.slopes[..., 0] / found.sd
    # 14,000 values, of which about 14,000/45 are independent.
    np.testing.assert_allclose(np.sqrt((scatter**2).mean(axis=0)), 1, atol=0.2)
    assert np.std(found.value[:, 0] / found.value_sd) == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize(("count", "used"), [(3, 3), (4, 3), (6, 5), (7, 7), (8, 7), (40, 7)])
def test_the_slopes_along_a_line_are_those_of_savitzky_and_golay(
    count: int, used: int, seed: int
) -> None:
    values = np.random.default_rng(seed).standard_normal((2, 3, count))
    expected = savgol_filter(values, used, 2, deriv=1, delta=0.3, axis=2)
    found = line_slopes(values, WINDOW, 0.3)
    # A slope is a sum of at most 7 products.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
