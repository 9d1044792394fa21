"""Do flows have one law? Against draws from the errors that the error model states."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import optimize

from granpinn.checks import shared_law
from granpinn.checks.shared_law import DIFFERENT, BestFit, SharedLaw, best_fit, compared
from granpinn.errors import CannotGoOn
from granpinn.physics.laws import DEFAULT
from granpinn.results import Covariance, Parameters, Result
from granpinn.results.assessment import Assessment
from granpinn.results.identified_law import IdentifiedLaw
from granpinn.results.record import CARE, GOOD
from granpinn.results.records import ErrorBars, Members
from granpinn.results.result import FlowOfLaw
from granpinn.uncertainty.error_model import Known, ends_of, load
from tests.examples import make_result

LAW = np.array([0.4, 0.64])
RANGES = ((0.01, 0.12), (0.02, 0.2), (0.1, 0.7))
THETA = (0.4, 0.64, 0.3)
NONE = np.zeros((2, 2))


def known(I: tuple[float, float], error: np.ndarray) -> Known:
    """A flow whose log mu is wrong by `error` at both ends."""
    x = ends_of(I, 0.3)
    at_ends = Known(x, (0.4, 0.64)).ends * np.exp(error)
    mu_s, mu_2 = np.linalg.solve([[1 - x[0], x[0]], [1 - x[1], x[1]]], at_ends)
    return Known(x, (float(mu_s), float(mu_2)))


def judged(flows: list[Known], free: bool = False) -> BestFit:
    law = DEFAULT.with_free({"I0": 0.3}) if free else DEFAULT
    return best_fit(flows, [NONE] * len(flows), np.ravel(RANGES[: len(flows)]), law, THETA)


def test_chi_square_is_that_of_the_law_that_fits_best(seed: int) -> None:
    errors = np.random.default_rng(seed).normal(0, 0.01, (3, 2))
    flows = [known(I, e) for I, e in zip(RANGES, errors, strict=True)]
    W = np.linalg.inv(np.linalg.cholesky(sum(load().of_flows(flows))))
    y = np.log(np.concatenate([flow.ends for flow in flows]))
    for free, start in ((False, [0.3, 0.5]), (True, [0.3, 0.5, 0.2])):

        def rest(p: np.ndarray) -> np.ndarray:
            theta = [*p, 0.3][:3]
            return W @ (y - np.log(DEFAULT.friction(np.ravel(RANGES), *theta)))

        best = optimize.least_squares(rest, start, xtol=1e-12, ftol=1e-12, gtol=1e-12)
        found = judged(flows, free)
        assert found.chi_square == pytest.approx(2 * best.cost, rel=1e-4)
        assert found.theta[: len(start)] == pytest.approx(best.x, rel=1e-3)
        assert found.freedom == 6 - len(start)
        assert 0 < found.p_value <= 1


@pytest.mark.parametrize("free", [False, True], ids=["I0 given", "I0 free"])
def test_one_law_is_seldom_called_two(free: bool, seed: int) -> None:
    """As often as stated, where errors are those of the model, common ones among them."""
    rng, draws, model = np.random.default_rng(seed), 300, load()
    right = [known(I, np.zeros(2)) for I in RANGES]
    triangle = np.linalg.cholesky(sum(model.of_flows(right)))
    alarms = 0
    for _ in range(draws):
        errors = (triangle @ rng.standard_normal(6)).reshape(3, 2)
        errors *= np.sqrt(model.freedom / rng.chisquare(model.freedom, (3, 1)))
        flows = [known(I, e) for I, e in zip(RANGES, errors, strict=True)]
        alarms += judged(flows, free).p_value < 0.1
    assert 0.05 < alarms / draws < 0.16


def test_errors_of_a_run_count_too() -> None:
    flows = [known(RANGES[0], np.zeros(2)), known(RANGES[1], np.full(2, 0.05))]
    I = np.ravel(RANGES[:2])
    alone = best_fit(flows, [NONE] * 2, I, DEFAULT, THETA)
    uncertain = best_fit(flows, [NONE, 0.03**2 * np.ones((2, 2))], I, DEFAULT, THETA)
    assert uncertain.chi_square < alone.chi_square / 2


C = np.array([[4e-6, -8e-6], [-8e-6, 1e-4]])


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
        members=Members((0,), {"mu_s": (0.4,), "mu_2": (0.64,)}),
        assumptions=(),
        covariance=Covariance(("mu_s", "mu_2"), tuple(map(tuple, matrix.tolist()))),
        error_bars=ErrorBars((0.002, 0.01), 8.0, 1.9, "a test"),
    )


def joint(*flows: Result) -> Result:
    good = Assessment("good", "good to use", ())
    listed = tuple(FlowOfLaw(r.input, r.data, r.law.I_range, r.residuals, good) for r in flows)
    return dataclasses.replace(single(LAW), flows=listed)


def test_another_friction_is_found_and_needs_care(monkeypatch: pytest.MonkeyPatch) -> None:
    def of_run(result: Result, case: object) -> Known:
        return Known(ends_of((0.01, 0.2), 0.3), (result.theta[0], result.theta[1]))

    monkeypatch.setattr(shared_law, "known_of", of_run)
    apart = [single(LAW), single(LAW + 0.05)]
    result = joint(*apart)

    def against(*laws: Result) -> SharedLaw:
        return compared(laws, [None] * len(laws), result)  # type: ignore[list-item]

    found = against(*apart)
    assert found.p_value < DIFFERENT
    assert found.words.startswith("the flows differ by more than their errors")
    assert found.reasons(result)[0].grade == CARE
    same = against(*[single(LAW)] * 2)
    assert same.p_value == pytest.approx(1, abs=1e-3)
    assert same.reasons(result)[0].grade == GOOD
    assert same.flows[0].mu_joint == pytest.approx(same.flows[0].mu)
    assert same.flows[0].mu_best == pytest.approx(same.flows[0].mu, rel=1e-3)
    assert same.theta[:2] == pytest.approx(LAW, rel=1e-3)
    lost = dataclasses.replace(single(LAW), covariance=None)
    with pytest.raises(CannotGoOn, match="no error bars by itself"):
        against(single(LAW), lost)
