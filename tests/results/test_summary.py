"""What the page says in words: numbers of a known result."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.physics.laws import free
from granpinn.results import ErrorPercent, InertialNumber
from granpinn.results.parameters import Parameter, Parameters
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
    assert (found.band.I_low, found.band.I_high) == (0.01, 0.2)  # of the curve, not of all grains
    assert (found.band.mu_low, found.band.mu_high) == (0.42, 0.49)
    assert found.band.half_width == pytest.approx(0.03)
    true = 0.4 + 0.24 * np.array([0.01, 0.045, 0.2]) / (np.array([0.01, 0.045, 0.2]) + 0.3)
    difference = np.abs(true - [0.42, 0.44, 0.49]).max()
    assert found.band.largest_difference == pytest.approx(difference)
    assert found.drift == pytest.approx({"μₛ": 0.2, "μ₂": 0.1})


def test_the_drift_of_a_free_curve_counts_where_the_data_lie() -> None:
    """The last coefficient lies far beyond the I of the curve, 0.01 to 0.2."""
    I_low, I_high = 1e-4, 1e3
    start = dict.fromkeys(free.LAW.curve, 0.4) | {"I_low": I_low, "I_high": I_high}
    result = dataclasses.replace(
        make_result(),
        law=dataclasses.replace(make_result().law, name=free.LAW.name),
        parameters=Parameters(
            {name: Parameter(value, name.startswith("I_")) for name, value in start.items()}
        ),
        covariance=None,
        error_percent=ErrorPercent(),
        members=None,
        truth=None,
    )
    history = {name: np.full(3, value) for name, value in start.items()}
    history["step"] = np.array([0.0, 90.0, 100.0])

    def drift(name: str) -> float:
        moved = history | {name: np.array([0.3, 0.4, 0.5])}
        found = summarize(result, moved).drift
        assert found is not None
        return found["μ(I)"]

    assert drift("c8") < 1e-3
    assert drift("c5") > 0.05
