"""Do flows have one law? Against draws from the errors that the results state."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.checks.shared_law import DIFFERENT, compared
from granpinn.errors import CannotGoOn
from granpinn.results import Covariance, Parameters, Result
from granpinn.results.assessment import Assessment
from granpinn.results.flow_of_law import FlowOfLaw
from granpinn.results.identified_law import IdentifiedLaw
from granpinn.results.record import CARE, GOOD
from granpinn.results.records import ErrorBars
from tests.examples import make_result

FREEDOM = 6.0
LAW = np.array([0.4, 0.64])
C = np.array([[4e-6, -8e-6], [-8e-6, 1e-4]])  # of one flow: scale of Student's distribution


def single(theta: np.ndarray, matrix: np.ndarray = C) -> Result:
    result = make_result()
    values = dict(result.parameters.items())
    for name, value in zip(("mu_s", "mu_2"), theta.tolist(), strict=True):
        values[name] = dataclasses.replace(
            values[name], value=value, std=None, interval_90=None, fixed=False
        )
    return dataclasses.replace(
        result,
        parameters=Parameters(values),
        law=IdentifiedLaw("mu_of_i", (0.01, 0.2)),
        covariance=Covariance(("mu_s", "mu_2"), tuple(map(tuple, matrix.tolist()))),
        error_bars=ErrorBars((0.002, 0.01), FREEDOM, 1.9, "a test"),
    )


def joint(*flows: Result) -> Result:
    good = Assessment("good", "good to use", ())
    listed = tuple(FlowOfLaw(r.input, r.data, r.law.I_range, r.residuals, good) for r in flows)
    return dataclasses.replace(single(LAW), flows=listed)


def test_chi_square_of_two_laws_by_hand() -> None:
    """Two equal covariances: half of the squared difference over the variance."""
    shift = np.array([0.003, 0.0])
    apart = [single(LAW + shift), single(LAW - shift)]
    found = compared(apart, joint(*apart))
    difference = 2 * shift
    variance = FREEDOM / (FREEDOM - 2) * C
    expected = difference @ np.linalg.solve(variance, difference) / 2
    assert found.chi_square == pytest.approx(expected)
    assert found.freedom == 2
    assert found.p_value == pytest.approx(np.exp(-expected / 2))  # of two degrees of freedom
    low, high = found.flows[0].mu
    x = np.array([0.01, 0.2]) / (np.array([0.01, 0.2]) + 0.3)
    assert [low, high] == pytest.approx(list(0.403 + x * (0.64 - 0.403)))
    assert found.flows[0].mu_joint == found.flows[1].mu_joint


def test_one_law_is_seldom_called_two(seed: int) -> None:
    rng, draws = np.random.default_rng(seed), 400
    matrices = [C, 4 * C, C[::-1, ::-1]]
    alarms = 0
    for _ in range(draws):
        apart = []
        for matrix in matrices:
            error = rng.multivariate_normal([0, 0], matrix) / np.sqrt(
                rng.chisquare(FREEDOM) / FREEDOM
            )
            apart.append(single(LAW + error, matrix))
        alarms += compared(apart, joint(*apart)).p_value < 0.1
    assert 0.03 < alarms / draws < 0.15


def test_another_friction_is_found_and_needs_care() -> None:
    apart = [single(LAW), single(LAW + 0.05)]
    result = joint(*apart)
    found = compared(apart, result)
    assert found.p_value < DIFFERENT
    assert found.words.startswith("the flows differ by more than their errors")
    assert found.reasons(result)[0].grade == CARE
    same = compared([single(LAW)] * 2, result)
    assert same.p_value == 1
    assert same.reasons(result)[0].grade == GOOD


def test_a_flow_without_error_bars_gives_no_number() -> None:
    apart = [single(LAW), dataclasses.replace(single(LAW), covariance=None)]
    with pytest.raises(CannotGoOn, match="no error bars by itself"):
        compared(apart, joint(*apart))
