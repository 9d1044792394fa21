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
    history = {
        "step": np.array([0.0, 90.0, 100.0]),
        "mu_s": np.array([0.3, 0.4, 0.5]),
        "mu_2": np.array([0.3, 0.55, 0.5]),
    }
    found = summarize(result, history)
    assert found.slope == pytest.approx(0.2 / 0.3)
    assert found.reaches == pytest.approx(2)
    assert found.stagnant == pytest.approx(0.25)  # 300 of 1200 points
    assert found.band is not None
    assert found.band.mu_high == pytest.approx(0.41 + 0.2 / (1 + 0.3 / 0.6))
    assert found.drift == {"mu_s": pytest.approx(0.2), "mu_2": pytest.approx(0.1)}
