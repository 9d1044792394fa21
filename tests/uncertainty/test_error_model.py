"""The error model: what it says of mu at the ends of a range of I, and what follows from that."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from granpinn.results.records import Assumed, Members
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import FEATURES, Known, ends_of, line

X, MU = (0.02, 0.3), (0.4, 0.64)


USUAL = Known(X, MU, misfit=0.003, law=0.005)


RULES: dict[str, float] = dict.fromkeys(error_model.COEFFICIENTS, 0.0)


MODEL = dataclasses.replace(
    error_model.load(),
    freedom=8.0,
    lower=RULES | {"constant": math.log(0.004)},
    upper=RULES | {"constant": math.log(0.01)},
    correlation=-0.3,
    common=0.4,
    level=0.02,
    tilt=0.01,
)


SHORT = (0.02, 0.1)  # with the same friction at both ends


SAME = tuple(np.linalg.solve(line(SHORT), line(X) @ MU).tolist())


ALONE = Members((0,), {"mu_s": MU[:1], "mu_2": MU[1:]})


# With which change of a run errors grow, by feature.
WORSE: dict[str, Known] = {
    "outline": USUAL._replace(outline=True),
    "noise": USUAL._replace(noise=0.5, misfit=0.5, vectors=10_000.0),
    "misfit": USUAL._replace(misfit=0.03),
    "law": USUAL._replace(law=0.04),
    "reach": USUAL._replace(x=SHORT, mu=SAME),
    "contrast": USUAL._replace(mu=(0.4, 0.8)),
}


def continued(of_ends: Any, known: Known) -> Any:
    """Covariance of (mu_s, mu_2) from that of log mu at both ends [2, 2]."""
    J = np.linalg.solve(line(known.x), np.diag(known.ends))
    return J @ of_ends @ J.T


def test_mu_s_and_mu_2_are_the_continuation_of_a_line() -> None:
    """By hand: mu at x = 0 and x = 1 of the line through (x1, mu1) and (x2, mu2)."""
    s = 0.004, 0.01
    (x1, x2), (m1, m2) = X, line(X) @ MU
    C = continued(MODEL.method(USUAL), USUAL)
    d1, d2 = np.array([m1 * s[0], 0]), np.array([0, m2 * s[1]])
    of_s = (x2 * d1 - x1 * d2) / (x2 - x1)
    of_2 = ((x2 - 1) * d1 + (1 - x1) * d2) / (x2 - x1)
    correlation = np.array([[1, -0.3], [-0.3, 1]])
    for j, a in enumerate((of_s, of_2)):
        for k, b in enumerate((of_s, of_2)):
            assert C[j, k] == pytest.approx(a @ correlation @ b)


@pytest.mark.parametrize("name", WORSE)
def test_errors_grow_with_what_went_wrong(name: str) -> None:
    """By the shipped numbers they never fall, and by a coefficient of that sign they grow."""
    usual, worse = error_model.load(), WORSE[name]
    assert np.all(usual.sd(worse) >= usual.sd(USUAL) * (1 - 1e-9))
    sign = FEATURES.get(name, 1)
    only = dataclasses.replace(MODEL, lower=MODEL.lower | {name: 0.5 * sign})
    assert only.sd(worse)[0] > only.sd(USUAL)[0]


@pytest.mark.parametrize(
    ("inside", "beyond", "quantity"),
    [
        (USUAL._replace(misfit=0.02), USUAL._replace(misfit=0.9), "misfit"),
        (USUAL._replace(law=0.02), USUAL._replace(law=0.5), "law"),
        (USUAL._replace(x=(0.02, 0.1)), USUAL._replace(x=(0.02, 0.03)), "reach"),
        (USUAL, USUAL._replace(mu=(0.4, 6.0)), "contrast"),
    ],
)
def test_beyond_the_fit_errors_grow_in_proportion(
    inside: Known, beyond: Known, quantity: str
) -> None:
    value = error_model.quantities(beyond)[quantity]
    limit = MODEL.tested[quantity][FEATURES[quantity] > 0]
    factor = max(value / limit, limit / value)
    assert factor > 1.5
    assert MODEL.sd(inside) == pytest.approx([0.004, 0.01])
    assert MODEL.sd(beyond) == pytest.approx([0.004 * factor, 0.01 * factor])
    (words,) = MODEL.outside(beyond)
    assert words.startswith(f"{error_model.WORDS[quantity]} = {value:.2g} (tested: ")
    assert MODEL.outside(inside) == ()


def test_noise_counts_by_the_number_of_vectors_and_hides_misfit() -> None:
    noisy = USUAL._replace(noise=0.2, misfit=0.2, vectors=4000.0)
    found, fewer = (error_model.quantities(k) for k in (noisy, noisy._replace(vectors=1000.0)))
    assert found["noise"] == pytest.approx(0.2 / 2 / (line(X) @ MU)[0])
    assert fewer["noise"] == pytest.approx(2 * found["noise"])
    assert found["misfit"] == pytest.approx(error_model.NOISE_PART * 0.2)
    beyond = error_model.quantities(noisy._replace(misfit=0.3))["misfit"]
    assert beyond == pytest.approx(math.sqrt(0.3**2 - 1.02 * 0.2**2 + 0.006**2))


def test_real_grains_depart_by_a_level_and_a_tilt() -> None:
    assert not MODEL.grains(USUAL).any()
    C = MODEL.grains(USUAL._replace(real=True))
    assert pytest.approx(np.array([[5e-4, 3e-4], [3e-4, 5e-4]])) == C
    mean, half = np.array([0.5, 0.5]), np.array([-0.5, 0.5])
    assert mean @ C @ mean == pytest.approx(0.02**2)
    assert half @ C @ half == pytest.approx(0.01**2)


def test_error_bars_are_the_sum_of_their_parts() -> None:
    three = Members((0, 1, 2), {"mu_s": (0.39, 0.40, 0.42), "mu_2": (0.64, 0.66, 0.60)})
    line = Assumed("surface line", "m", 0.01, "one grain higher", {"mu_s": 2.0, "mu_2": -5.0})
    known = USUAL._replace(real=True)
    found = error_bars.estimate(three, known, MODEL, (line,))
    parts = continued(MODEL.method(known) + MODEL.grains(known), known)
    parts = parts + np.cov([three.values["mu_s"], three.values["mu_2"]]) / 3
    parts = parts + np.outer([0.02, -0.05], [0.02, -0.05])
    np.testing.assert_allclose(found.covariance.matrix, parts, rtol=1e-12)
    bars = found.bars
    assert bars.assumptions == pytest.approx((0.02, 0.05))
    squares = [np.square(p) for p in (bars.method, bars.grains, bars.scatter, bars.assumptions)]
    np.testing.assert_allclose(np.sum(squares, axis=0), np.diag(parts), rtol=1e-12)
    alone = error_bars.estimate(ALONE, USUAL, MODEL).bars
    assert (alone.grains, alone.scatter, alone.assumptions) == (None, None, None)


def test_intervals_are_those_of_student_and_hold_no_negative_friction() -> None:
    found = error_bars.estimate(ALONE, USUAL, MODEL).parameters
    half = stats.t.ppf(0.95, 8.0)
    for parameter in found.values():
        low, high = parameter.interval_90
        reach = half * parameter.std / parameter.value
        assert math.log(high / parameter.value) == pytest.approx(reach)
        assert math.log(parameter.value / low) == pytest.approx(reach)
    lost = Known((0.1, 0.1 + 1e-6), MU, misfit=5.0, law=3.0, noise=2.0)
    for parameter in error_bars.estimate(ALONE, lost, error_model.load()).parameters.values():
        low, high = parameter.interval_90
        assert 0 < low < parameter.value < high < math.inf


def test_intervals_cover_as_often_as_stated(seed: int) -> None:
    """Errors of log mu at both ends, drawn from the model."""
    draws = 2000
    s = MODEL.sd(USUAL)
    C = MODEL.method(USUAL)
    rng = np.random.default_rng(seed)
    e = rng.multivariate_normal([0, 0], C, draws) / np.sqrt(rng.chisquare(8, (draws, 1)) / 8)
    held = np.zeros(2)
    for row in e:
        mu = np.linalg.solve(line(X), (line(X) @ MU) * np.exp(row))
        members = Members((0,), {"mu_s": (mu[0],), "mu_2": (mu[1],)})
        found = error_bars.estimate(members, USUAL._replace(mu=tuple(mu.tolist())), MODEL)
        ends = [p.interval_90 for p in found.parameters.values()]
        held += [low <= t <= high for (low, high), t in zip(ends, MU, strict=True)]
    assert s.shape == (2,)
    assert held / draws == pytest.approx(0.9, abs=0.025)


def test_the_shipped_model_is_sound() -> None:
    usual = error_model.load()
    sd = usual.sd(USUAL)
    assert np.all((sd > 5e-4) & (sd < 0.03))
    assert 0 < usual.level < 0.1
    assert 0 < usual.tilt < 0.1
    assert usual.outside(USUAL) == ()
    numbers = len(usual.lower) + len(usual.upper)
    numbers += len(("correlation", "level", "tilt", "free_curve", "cohesion", "cohesion_part"))
    assert numbers <= 24


def test_no_feature_of_the_shipped_model_makes_errors_smaller() -> None:
    model = error_model.load()
    for b in (model.lower, model.upper):
        assert tuple(b) == error_model.COEFFICIENTS
        assert all(sign * b[name] >= 0 for name, sign in FEATURES.items())
        assert b["outline"] >= 0
    assert tuple(model.tested) == tuple(error_model.WORDS)


def test_a_model_with_an_unknown_number_is_refused(tmp_path: Path) -> None:
    content = json.loads(error_model.PATH.read_text(encoding="utf-8"))
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content | {"levle": 0.02}), encoding="utf-8")
    with pytest.raises(ValueError, match="levle is not known"):
        error_model.load(path)


OTHER = USUAL._replace(x=(0.2, 0.6), real=True)


def covariance_of(flows: list[Known]) -> Any:
    J = error_bars.continuation(flows, MODEL)
    return J @ sum(MODEL.of_flows(flows)) @ J.T


def test_flows_with_one_law_are_one_least_squares_fit(seed: int) -> None:
    """Generalised least squares over both ends of both flows, drawn from the model."""
    flows = [USUAL, OTHER, OTHER]
    C = np.zeros((6, 6))
    for f, a in enumerate(flows):
        for g, b in enumerate(flows):
            own = MODEL.method(a) + MODEL.grains(a)
            level = a.real * b.real * 0.4 * MODEL.level**2 * np.ones((2, 2))
            C[2 * f : 2 * f + 2, 2 * g : 2 * g + 2] = own if f == g else level
    J = np.vstack([np.diag(1 / known.ends) @ line(known.x) for known in flows])
    weights = np.linalg.inv(C)
    fit = np.linalg.solve(J.T @ weights @ J, J.T @ weights)
    rng = np.random.default_rng(seed)
    drawn = rng.multivariate_normal(J @ MU, C, 20_000) @ fit.T
    found = covariance_of(flows)
    np.testing.assert_allclose(found, np.cov(drawn.T), rtol=0.1)
    np.testing.assert_allclose(found, fit @ C @ fit.T, rtol=1e-9)


def test_I0_needs_flows_with_other_ranges() -> None:
    slow, fast = (Known(ends_of(I, 0.3), MU, I0=0.3) for I in ((0.01, 0.1), (0.2, 0.8)))
    assert error_bars.sd_of([fast, fast], MODEL)["I0"] == math.inf
    assert error_bars.sd_of([slow, fast], MODEL)["I0"] < 0.1
