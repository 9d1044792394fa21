"""The law of several flows: generalised least squares over the laws of the single flows."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from granpinn import one_law
from granpinn.checks.shared_law import DIFFERENT
from granpinn.checks.unknown_I0 import UnknownI0
from granpinn.errors import BadInput, CannotGoOn
from granpinn.physics.laws import DEFAULT
from granpinn.results import Covariance, Parameters, Residuals, Result
from granpinn.results.record import CARE, GOOD
from granpinn.results.records import Assumed, ErrorBars, IdentifiedLaw, LawPoints, Members
from granpinn.uncertainty.error_model import Known, ends_of, line, load
from granpinn.uncertainty.one_law import Gathered, LeastSquares, fit
from tests.examples import make_result

LAW = np.array([0.4, 0.64])
RANGES = ((0.01, 0.12), (0.02, 0.2), (0.1, 0.7))
I = np.ravel(RANGES)
THETA = (0.4, 0.64, 0.3)
FLOWS = [Known(ends_of(own, 0.3), (0.4, 0.64)) for own in RANGES]


def covariance() -> np.ndarray:
    return np.asarray(sum(load().of_flows(FLOWS)))


def fitted_to(errors: np.ndarray, free: bool, theta: tuple[float, ...] = THETA) -> LeastSquares:
    """The fit to laws whose log mu is wrong by `errors` [6] at the ends."""
    y = np.log(DEFAULT.friction(I, *theta)) + errors
    law = DEFAULT.with_free({"I0": 0.3}) if free else DEFAULT
    return fit(Gathered(I, y, {"method": covariance()}, [np.eye(2)] * 3), law, THETA)


@pytest.mark.parametrize("free", [False, True], ids=["I0 given", "I0 free"])
def test_the_law_is_that_of_least_squares(free: bool, seed: int) -> None:
    errors = np.random.default_rng(seed).normal(0, 0.01, 6)
    found, start = fitted_to(errors, free), THETA[: 2 + free]
    W = np.linalg.inv(np.linalg.cholesky(covariance()))
    y = np.log(DEFAULT.friction(I, *THETA)) + errors

    def rest(p: np.ndarray) -> np.ndarray:
        return np.asarray(W @ (y - np.log(DEFAULT.friction(I, *[*p, 0.3][:3]))))

    best = optimize.least_squares(rest, start, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert found.chi_square == pytest.approx(2 * best.cost, rel=1e-4)
    assert found.theta[: len(start)] == pytest.approx(best.x, rel=1e-3)
    assert found.freedom == 6 - len(start)
    assert 0 < found.p_value <= 1


def test_another_I0_is_found() -> None:
    truth = (0.35, 0.6, 0.18)
    found = fitted_to(np.zeros(6), True, truth)
    assert found.theta == pytest.approx(truth, rel=1e-6)
    assert found.chi_square == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("free", [False, True], ids=["I0 given", "I0 free"])
def test_errors_and_alarms_are_those_that_are_stated(free: bool, seed: int) -> None:
    """Draws from the error model, whose errors are in part common to all flows."""
    rng, draws, model = np.random.default_rng(seed), 300, load()
    triangle = np.linalg.cholesky(covariance())
    alarms, theta = 0, []
    for _ in range(draws):
        errors = (triangle @ rng.standard_normal(6)).reshape(3, 2)
        errors *= np.sqrt(model.freedom / rng.chisquare(model.freedom, (3, 1)))
        found = fitted_to(np.ravel(errors), free)
        alarms += found.p_value < 0.1
        theta.append(found.theta[: 2 + free])
    assert 0.05 < alarms / draws < 0.16
    right = fitted_to(np.zeros(6), free)
    stated = np.sqrt(np.diag(right.J @ covariance() @ right.J.T))
    scatter = np.diff(np.quantile(theta, (0.16, 0.84), axis=0), axis=0)[0] / 2
    np.testing.assert_allclose(scatter, stated, rtol=0.25)


C = np.array([[4e-6, -8e-6], [-8e-6, 1e-4]])


def single(theta: Any = LAW, I_range: tuple[float, float] = (0.01, 0.2), **changes: Any) -> Result:
    result = make_result()
    values = dict(result.parameters.items())
    for name, value in zip(("mu_s", "mu_2"), np.asarray(theta).tolist(), strict=True):
        values[name] = dataclasses.replace(values[name], value=value, fixed=False)
    return dataclasses.replace(
        result,
        **{
            "parameters": Parameters(values),
            "law": IdentifiedLaw("mu_of_i", I_range),
            "members": Members((0,), {"mu_s": (0.4,), "mu_2": (0.64,)}),
            "assumptions": (),
            "covariance": Covariance(("mu_s", "mu_2"), tuple(map(tuple, C.tolist()))),
            "error_bars": ErrorBars((0.002, 0.01), 8.0, 1.9, "a test"),
            **changes,
        },
    )


def test_another_friction_is_found_and_needs_care() -> None:
    found = one_law([single(), single(LAW + 0.05)])
    check = found.checks["shared_law"]
    assert check.p_value < DIFFERENT
    assert check.words.startswith("the flows differ by more than their errors")
    assert check.reasons(found)[0].grade == CARE
    same = one_law([single(), single()])
    check = same.checks["shared_law"]
    assert check.p_value == pytest.approx(1, abs=1e-3)
    assert check.reasons(same)[0].grade == GOOD
    assert check.flows[0].mu_joint == pytest.approx(check.flows[0].mu)
    assert "I0 is held at 0.3: all flows have the same range of I" in check.words
    assert same.theta[:2] == pytest.approx(LAW)
    assert same.parameters["I0"].fixed


def test_an_assumption_of_one_flow_moves_the_law_of_all() -> None:
    surface = Assumed(
        "surface line", "1", 0.1, "higher", {"mu_s": 0.02, "mu_2": 0.05}, {"mu_s": 1, "mu_2": 2}
    )
    flows = [single(I_range=own) for own in RANGES]
    plain = one_law(flows)
    found = one_law([dataclasses.replace(flows[0], assumptions=(surface,)), *flows[1:]])
    (assumed,) = found.assumptions
    assert (assumed.name, assumed.example) == ("surface line of Säule µ.h5", "higher in Säule µ.h5")
    step = 0.01  # the law moves in proportion
    moved = single(LAW + step * np.array([0.02, 0.05]), RANGES[0], assumptions=(surface,))
    after = one_law([moved, *flows[1:]])
    slope = (np.array(after.theta) - found.theta)[:2] / step
    assert list((assumed.derivative or {}).values()) == pytest.approx(slope, rel=0.02)
    assert found.parameters["mu_s"].std > plain.parameters["mu_s"].std


def test_a_flow_counts_by_its_errors() -> None:
    """A training that is far too short has wide error bars, and moves the law little."""
    short = dataclasses.replace(make_result().timing, steps=300)
    found = one_law([single(), single(LAW * 1.05, timing=short)])
    assert found.theta[0] < 0.405


def test_the_same_flow_twice_is_not_more_than_with_half_the_variance() -> None:
    once = one_law([single(I_range=own) for own in RANGES])
    twice = one_law([single(I_range=own) for own in RANGES * 2])
    assert twice.theta == pytest.approx(once.theta)
    before, after = (np.sqrt(np.diag(r.covariance.matrix)) for r in (once, twice) if r.covariance)
    assert np.all(after >= 0.999 * before / 2**0.5)


WIDE = (*RANGES, (0.2, 2.0))


@pytest.mark.parametrize(
    ("ranges", "noise", "I0", "free", "words"),
    [
        (WIDE, 0.0, 0.3, True, "I0 is identified: the flows leave a standard deviation of"),
        (RANGES[:2], 0.0, 0.3, False, "I0 is held at 0.3: the flows leave a standard deviation of"),
        (WIDE, 0.05, 0.3, False, "I0 is held at 0.3: the noise of a flow is 5 % of its speed"),
        (WIDE, 0.0, 0.25, False, "I0 is held at 0.25, as given"),
    ],
)
def test_I0_is_free_where_the_flows_determine_it(
    ranges: tuple[tuple[float, float], ...], noise: float, I0: float, free: bool, words: str
) -> None:
    results = []
    for own in ranges:
        made = single(I_range=own)
        values = dict(made.parameters.items())
        values["I0"] = dataclasses.replace(values["I0"], value=I0)
        noisy = Residuals(dict(made.residuals or {}) | {"noise": noise})
        surface = Assumed(
            "line", "1", 0.1, "up", {"mu_s": 0.0, "mu_2": 0.1}, {"mu_s": 0.0, "mu_2": 1.0}
        )
        changed = {"parameters": Parameters(values), "residuals": noisy, "assumptions": (surface,)}
        results.append(dataclasses.replace(made, **changed))
    found = one_law(results)
    assert found.checks["shared_law"].I0.startswith(words)
    assert found.parameters["I0"].fixed != free
    assert found.covariance is not None
    assert len(found.covariance.names) == 2 + free
    assert all(("I0" in (a.derivative or {})) == free for a in found.assumptions)


def test_the_curvature_that_a_flow_shows_determines_I0() -> None:
    """Of one flow of two the law with I0 free is known, at three inertial numbers."""
    truth, own = (0.4, 0.64, 0.2), (0.05, 0.5)
    at = np.geomspace(*own, 3)
    C = np.diag(np.full(3, 0.001**2))
    points = LawPoints(
        tuple(at), tuple(np.log(DEFAULT.friction(at, *truth))), tuple(map(tuple, C.tolist()))
    )
    free = UnknownI0((0.075, 1.2), Parameters({}), points)
    chute = single(I_range=own, checks={"unknown_I0": free})
    ends = np.array([0.01, 0.1])
    near = np.linalg.solve(line(ends_of((0.01, 0.1), 0.3)), DEFAULT.friction(ends, *truth))
    found = one_law([single(near, I_range=(0.01, 0.1)), chute])
    assert not found.parameters["I0"].fixed
    assert found.theta == pytest.approx(truth, rel=1e-3)
    assert found.parameters["I0"].std < 0.15 * truth[2]
    assert found.checks["shared_law"].freedom == 2
    # The ends of one range do not determine I0; the points between them do.
    twice = one_law([chute, chute])
    assert "I0 is identified" in twice.checks["shared_law"].I0
    assert twice.parameters["I0"].undetermined is None
    low, high = twice.parameters["I0"].interval_90 or (math.nan, math.nan)
    assert low < truth[2] < high


def test_results_that_cannot_be_weighed_are_refused() -> None:
    lost = single(residuals=None)
    with pytest.raises(CannotGoOn, match=r"does not determine mu\(I\)"):
        one_law([single(), lost])
    with pytest.raises(BadInput, match="expected two results or more with one given I0, got 1"):
        one_law([single()])
