"""Slopes along a line against the filter of SciPy."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from granpinn.estimates.quadratic_fits import line_slopes

WINDOW = 7


@pytest.mark.parametrize(("count", "used"), [(3, 3), (4, 3), (6, 5), (7, 7), (8, 7), (40, 7)])
def test_the_slopes_along_a_line_are_those_of_savitzky_and_golay(
    count: int, used: int, seed: int
) -> None:
    values = np.random.default_rng(seed).standard_normal((2, 3, count))
    expected = savgol_filter(values, used, 2, deriv=1, delta=0.3, axis=2)
    found = line_slopes(values, WINDOW, 0.3)
    # A slope is a sum of at most 7 products.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
