"""Which law a free curve supports, from synthetic curves with a known error."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from granpinn.checks.comparison_of_laws import LawComparison
from granpinn.physics.laws import LAWS, free
from granpinn.results import Parameter, Parameters
from granpinn.results.compared_law import ComparedLaw
from granpinn.training.information import BOXES, Information
from granpinn.uncertainty import law_choice
from granpinn.uncertainty.curve import POINTS
from granpinn.uncertainty.free_curve import Quadratic, basis, model_covariance, quadratic
from granpinn.uncertainty.law_choice import (
    Cohesion,
    CurveBand,
    Fit,
    choice,
    fits,
    with_cohesion,
)

ENDS = (0.01, 0.5)
N = free.COEFFICIENTS
I = np.geomspace(*ENDS, POINTS)
SD = 0.003


def coefficients(mu: np.ndarray) -> np.ndarray:
    """Of the free curve that is nearest to mu at `I`."""
    return np.asarray(np.linalg.lstsq(basis(I, *ENDS), mu, rcond=None)[0])


def curve_of(mu: np.ndarray, blocks: int = 8, seed: int = 0) -> Quadratic:
    """A free curve with the error SD, from blocks of time that scatter by as much as that says."""
    rng = np.random.default_rng(seed)
    H = basis(I, *ENDS).T @ basis(I, *ENDS) / SD**2
    root = np.linalg.cholesky(H / blocks)
    scores = rng.normal(size=(blocks, N)) @ root.T
    information = np.tile(H / blocks, (blocks, 1, 1))
    V = np.asarray(np.linalg.inv(H), np.float64)
    return Quadratic(coefficients(mu), scores - scores.mean(0), information, H, V, 1.0)


def compared(mu: np.ndarray, half: float = 0.01) -> tuple[tuple[ComparedLaw, ...], str, list[Fit]]:
    curve = curve_of(mu)
    at = law_choice.knots(ENDS)
    B = basis(at, *ENDS)
    C = B @ curve.covariance @ B.T + SD**2 * np.eye(N)
    band = CurveBand(
        I, basis(I, *ENDS) @ curve.center, np.full(I.shape, half), np.full(I.shape, half)
    )
    found = fits(curve, ENDS, band, C, {})
    return *choice(found, band), found


def friction(law: str, *theta: float) -> np.ndarray:
    return np.asarray(LAWS[law].friction(I, *theta) + 0 * I)


def test_a_constant_friction_is_chosen_where_it_explains_the_data() -> None:
    records, chosen, _ = compared(np.full(I.shape, 0.41))
    assert chosen == records[0].law == "coulomb"
    assert set(records[0].not_told_apart_from) >= {"mu_of_i", "power", "free"}
    assert records[0].parameters.mu_s.value == pytest.approx(0.41, abs=2 * SD)
    words = LawComparison(records, chosen).words
    assert words.startswith("a constant friction of 0.41 explains these data as well as ")
    assert "is not known" in words


@pytest.mark.parametrize("I0", [0.2, 0.3, 0.45])
def test_mu_of_i_excludes_a_constant_friction(I0: float) -> None:
    records, chosen, found = compared(friction("mu_of_i", 0.38, 0.64, I0))
    assert chosen == "mu_of_i"
    by_name = {c.law: c for c in records}
    assert "coulomb" not in by_name["mu_of_i"].not_told_apart_from
    assert "excluded: constant friction" in LawComparison(records, chosen).words
    assert by_name["coulomb"].score < by_name["mu_of_i"].score - 100
    fit = next(f for f in found if f.law.name == "mu_of_i")
    np.testing.assert_allclose(fit.mu, friction("mu_of_i", 0.38, 0.64, I0), atol=0.01)


def test_a_curve_of_no_named_law_stays_free() -> None:
    falls_and_rises = 0.4 + 0.06 * np.cos(3 * np.linspace(-1, 1, I.size))
    records, chosen, _ = compared(falls_and_rises)
    assert chosen == "free"
    assert records[0].not_told_apart_from == ()
    words = LawComparison(records, chosen).words
    assert words.startswith("free curve explains these data; excluded: ")


def test_laws_that_differ_by_less_than_the_band_are_not_told_apart() -> None:
    mu = friction("mu_of_i", 0.38, 0.45, 0.3)
    assert compared(mu, half=0.005)[1] == "mu_of_i"
    records, chosen, _ = compared(mu, half=0.05)
    assert chosen == "coulomb"
    assert "mu_of_i" in records[0].not_told_apart_from


def test_what_the_data_do_not_tell_is_not_determined() -> None:
    records, *_ = compared(friction("mu_of_i", 0.38, 0.64, 0.3))
    own = next(c for c in records if c.law == "mu_of_i").parameters
    assert own.mu_s.std is not None
    assert own.mu_s.interval_90 is not None
    assert own.mu_s.interval_90[0] < 0.38 < own.mu_s.interval_90[1]
    flat, *_ = compared(np.full(I.shape, 0.41))
    law = next(c for c in flat if c.law == "mu_of_i").parameters
    assert not law.I0.determined
    assert "I0 not determined" in str(LawComparison(flat, "coulomb"))


def cohesion(c: float) -> Cohesion:
    values = Parameters({"mu_s": Parameter(0.3, False), "mu_2": Parameter(0.5, False)})
    values = Parameters(
        {**dict(values.items()), "I0": Parameter(0.3, True), "c": Parameter(c, False)}
    )
    return Cohesion(values, c, 1.0, 2.0, 50.0)


def test_a_clear_cohesion_leaves_no_other_law() -> None:
    records, chosen, _ = compared(friction("mu_of_i", 0.38, 0.64, 0.3))
    wet, of_wet = with_cohesion(records, chosen, cohesion(10.0))
    assert of_wet == wet[0].law == "cohesive"
    assert wet[0].not_told_apart_from == ()
    assert wet[0].parameters.c.interval_90 == pytest.approx((10 - 3.29, 10 + 3.29), abs=0.01)
    assert {c.law: c.score for c in wet[1:]} == {c.law: c.score - 50.0 for c in records}
    assert all(c.score <= 0 for c in wet if c.law != "free")


def information(rng: np.random.Generator, L: int, prior: float = 0.0) -> Information:
    """J^T r and J^T J by boxes, of residuals that do not know the trained parameters."""
    J = rng.normal(size=(BOXES**3, 6, L))
    r = rng.normal(size=(BOXES**3, 6))
    free_part = torch.as_tensor(rng.uniform(0.3, 0.5, L))
    scores = torch.as_tensor(np.einsum("bnl,bn->bl", J, r))
    squares = torch.as_tensor(np.einsum("bnl,bnm->blm", J, J))
    return Information(free_part, scores, squares, prior * torch.eye(L).double())


def test_independent_residuals_have_the_covariance_of_their_number(seed: int) -> None:
    """White residuals of variance 1: V = H^-1 and tau = 1, up to the scatter of the boxes."""
    found = quadratic(information(np.random.default_rng(seed), N), N)
    assert found is not None
    assert found.temperature == pytest.approx(1, abs=0.6)
    ratio = np.diag(found.covariance) / np.diag(np.linalg.inv(found.curvature))
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
