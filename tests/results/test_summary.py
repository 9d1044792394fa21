"""What the page says in words: numbers of a known result."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.results import InertialNumber
from granpinn.results.summary import summarize
from tests.examples import make_result


def test_numbers_of_a_known_result() -> None:
    """mu_s = 0.41, mu_2 = 0.61, I0 = 0.3; the data reach I = 0.6."""
    result = make_result(inertial_number=InertialNumber(q05=1e-4, median=0.02, q95=0.6))
    found = summarize(result)
    assert found.slope == pytest.approx(0.2 / 0.3)
    assert found.reaches == pytest.approx(2)
    assert found.stagnant == pytest.approx(0.25)  # 300 of 1200 points
    assert found.band is not None
    assert (found.band.I_low, found.band.I_high) == (0.01, 0.2)  # of the curve, not of all grains
    assert (found.band.mu_low, found.band.mu_high) == (0.42, 0.49)
    assert found.band.half_width == pytest.approx(0.03)
    true = 0.4 + 0.24 * np.array([0.01, 0.045, 0.2]) / (np.array([0.01, 0.045, 0.2]) + 0.3)
    difference = np.abs(true - [0.42, 0.44, 0.49]).max()
    assert found.band.largest_difference == pytest.approx(difference)
