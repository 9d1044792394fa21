"""Which law a free curve supports, from synthetic curves with a known error."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from granpinn.checks.comparison_of_laws import (
    ALIKE,
    CHOSEN,
    EXCLUDED,
    ComparedLaw,
    LawComparison,
    cohesive_law,
    compared,
    fit_to_curve,
    knots,
    with_cohesion,
)
from granpinn.physics.laws import LAWS, free
from granpinn.training.information import BOXES, Information
from granpinn.uncertainty.curve_error import CurveBand, basis, model_covariance, quadratic
from granpinn.uncertainty.determined import POINTS

ENDS = (0.01, 0.5)


N = free.COEFFICIENTS


I = np.geomspace(*ENDS, POINTS)


SD = 0.003


def laws_of(mu: np.ndarray, half: float = 0.01) -> dict[str, ComparedLaw]:
    """The laws near a free curve with the error SD, the chosen one first."""
    B, at = basis(I, *ENDS), basis(knots(ENDS), *ENDS)
    center = np.linalg.lstsq(B, mu, rcond=None)[0]
    C = at @ np.linalg.inv(B.T @ B / SD**2) @ at.T + SD**2 * np.eye(N)
    band = CurveBand(I, B @ center, np.full(I.shape, half), np.full(I.shape, half))
    return {law.law: law for law in compared(band, (*center.tolist(), *ENDS), C, {})}


def words(laws: dict[str, ComparedLaw]) -> str:
    return LawComparison(tuple(laws.values())).words


def chosen(laws: dict[str, ComparedLaw]) -> str:
    first = next(iter(laws.values()))
    assert [law.verdict for law in laws.values()].count(CHOSEN) == 1
    assert first.verdict == CHOSEN
    return first.law


def alike(laws: dict[str, ComparedLaw]) -> set[str]:
    return {law.law for law in laws.values() if law.verdict == ALIKE}


def friction(law: str, *theta: float) -> np.ndarray:
    return np.asarray(LAWS[law].friction(I, *theta) + 0 * I)


def test_a_constant_friction_is_chosen_where_it_explains_the_data() -> None:
    laws = laws_of(np.full(I.shape, 0.41))
    assert chosen(laws) == "coulomb"
    assert alike(laws) >= {"mu_of_i", "power", "free"}
    assert laws["coulomb"].parameters.mu_s.value == pytest.approx(0.41, abs=2 * SD)
    assert words(laws).startswith("a constant friction of 0.41 explains these data as well as ")
    assert "is not known" in words(laws)


@pytest.mark.parametrize("I0", [0.2, 0.3, 0.45])
def test_mu_of_i_excludes_a_constant_friction(I0: float) -> None:
    laws = laws_of(friction("mu_of_i", 0.38, 0.64, I0))
    assert chosen(laws) == "mu_of_i"
    assert laws["coulomb"].verdict == EXCLUDED
    assert "excluded: constant friction" in words(laws)
    theta = [p.value for p in laws["mu_of_i"].parameters.values()]
    np.testing.assert_allclose(
        friction("mu_of_i", *theta), friction("mu_of_i", 0.38, 0.64, I0), atol=0.01
    )


def test_a_fit_has_its_curve_at_other_inertial_numbers() -> None:
    at = knots(ENDS)
    m = LAWS["mu_of_i"].friction(at, 0.38, 0.64, 0.3)
    fit = fit_to_curve(LAWS["mu_of_i"], {}, I, at, m, np.eye(N) / SD)
    np.testing.assert_allclose(fit.mu, friction("mu_of_i", *fit.theta))
    assert fit.chi2 == pytest.approx(0, abs=1e-6)
    assert set(fit.std) == {"mu_s", "mu_2", "I0"}


def test_a_curve_of_no_named_law_stays_free() -> None:
    laws = laws_of(0.4 + 0.06 * np.cos(3 * np.linspace(-1, 1, I.size)))
    assert chosen(laws) == "free"
    assert alike(laws) == set()
    assert words(laws).startswith("free curve explains these data; excluded: ")


def test_laws_that_differ_by_less_than_the_band_are_not_told_apart() -> None:
    mu = friction("mu_of_i", 0.38, 0.45, 0.3)
    assert chosen(laws_of(mu, half=0.005)) == "mu_of_i"
    laws = laws_of(mu, half=0.05)
    assert chosen(laws) == "coulomb"
    assert "mu_of_i" in alike(laws)


def test_what_the_data_do_not_tell_is_not_determined() -> None:
    own = laws_of(friction("mu_of_i", 0.38, 0.64, 0.3))["mu_of_i"].parameters
    assert own.mu_s.std is not None
    assert own.mu_s.interval_90 is not None
    assert own.mu_s.interval_90[0] < 0.38 < own.mu_s.interval_90[1]
    flat = laws_of(np.full(I.shape, 0.41))
    assert not flat["mu_of_i"].parameters.I0.determined
    assert "I0 not determined" in str(LawComparison(tuple(flat.values())))


def test_a_clear_cohesion_leaves_no_other_law() -> None:
    laws = tuple(laws_of(friction("mu_of_i", 0.38, 0.64, 0.3)).values())
    wet = with_cohesion(laws, cohesive_law((0.3, 0.5, 0.3, 10.0), 10.0, 1.0, 2.0))
    assert (wet[0].law, wet[0].verdict) == ("cohesive", CHOSEN)
    assert {law.verdict for law in wet[1:]} == {EXCLUDED}
    assert wet[0].parameters.c.interval_90 == pytest.approx((10 - 3.29, 10 + 3.29), abs=0.01)
    assert [law.parameters for law in wet[1:]] == [law.parameters for law in laws]


def test_a_cohesion_that_may_be_0_is_told_from_others_as_mu_of_i_is() -> None:
    may_be_0 = cohesive_law((0.3, 0.5, 0.3, 2.0), 2.0, 1.0, 2.0)
    assert not may_be_0.parameters.c.determined
    for mu, verdict in (
        (np.full(I.shape, 0.41), ALIKE),
        (0.4 + 0.06 * np.cos(3 * np.linspace(-1, 1, I.size)), EXCLUDED),
    ):
        laws = laws_of(mu)
        found = with_cohesion(tuple(laws.values()), may_be_0)
        assert found[-1].law == "cohesive"
        assert found[-1].verdict == verdict
        assert found[:-1] == tuple(laws.values())


def information(rng: np.random.Generator, L: int, prior: float = 0.0) -> Information:
    """J^T r and J^T J by boxes, of residuals that do not know the trained parameters."""
    J = rng.normal(size=(BOXES**3, 6, L))
    r = rng.normal(size=(BOXES**3, 6))
    free_part = torch.as_tensor(rng.uniform(0.3, 0.5, L))
    scores = torch.as_tensor(np.einsum("bnl,bn->bl", J, r))
    squares = torch.as_tensor(np.einsum("bnl,bnm->blm", J, J))
    return Information(free_part, scores, squares, prior * torch.eye(L).double())


def test_independent_residuals_have_the_covariance_of_their_number(seed: int) -> None:
    """White residuals of variance 1: V = H^-1, up to the scatter of the boxes."""
    loss = information(np.random.default_rng(seed), N)
    found = quadratic(loss, N)
    assert found is not None
    H = loss.information.sum(0).numpy()
    ratio = np.diag(found.covariance) / np.diag(np.linalg.inv(H))
    assert np.all((ratio > 0.3) & (ratio < 4))


def test_errors_of_the_law_are_those_of_its_ends() -> None:
    """Between the ends they are linear in log I."""
    mu = np.full(I.shape, 0.4)
    of_ends = np.array([[4e-4, -1e-4], [-1e-4, 9e-4]])
    C = model_covariance(I, mu, ENDS, of_ends)
    ends = np.ix_([0, -1], [0, -1])
    np.testing.assert_allclose(C[ends], 0.16 * of_ends)
    middle = np.interp(np.log(ENDS).mean(), np.log(I), np.diag(C))
    assert middle == pytest.approx(0.16 * (4e-4 + 9e-4 - 2e-4) / 4, rel=1e-3)
    wider = model_covariance(np.array([1e-4, 5.0]), mu[:2], ENDS, of_ends)
    np.testing.assert_allclose(wider, 0.16 * of_ends)
