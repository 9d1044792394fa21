r"""One friction law of several flows of one material: the fit to the laws of the single flows.

Flow f by itself gives log mu at both ends of its range of I. Where I0 is free, flows of which it is
known give log mu at three inertial numbers (checks/unknown_I0.py). With all of them y [n], their
errors of covariance C, and one law $\theta$ of L parameters that fits them best,

$$ \chi^2 = \min_\theta\, (y - \log\mu(\theta))^T C^{-1} (y - \log\mu(\theta)). $$

C has every part of the error bars: method, grains, whose level is in part common to all flows
(error_model.py), assumptions, and the scatter over seeds. So every flow counts by its errors. With
the slopes K of log mu by the parameters, the covariance of $\theta$ is $J C J^T$,

$$ J = (K^T C^{-1} K)^{-1} K^T C^{-1} . $$

p is the share of draws from these errors with a larger chi-square. So a p below 0.01 is a false
alarm in 1 % of all groups, as far as the error model is right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import scipy

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.physics.laws import DEFAULT, FrictionLaw
from granpinn.results import Result
from granpinn.results.records import LawPoints
from granpinn.uncertainty import error_bars
from granpinn.uncertainty.curve_error import between
from granpinn.uncertainty.determined import LARGEST
from granpinn.uncertainty.error_bars import Estimate, bars_of, covariance, scatter
from granpinn.uncertainty.error_model import Known, ends_of, load
from granpinn.uncertainty.expected import too_noisy

DRAWS, SEED = 20_000, 0
STARTS = (1.0, 0.5, 2.0)  # of I0, over that of the single fits
STEPS, LONGEST = 20, 0.5  # of the fit, in the logarithms of mu_s, mu_2 - mu_s and I0


class OneLaw(NamedTuple):
    """The law of F flows.

    Attributes:
        fit: to the laws of the single flows.
        estimate: the parameters with their error bars.
        I0: whether it was identified or held, and why, in words.
        reason: why there are no error bars; None: there are.
        slopes: of its L free parameters by mu_s and mu_2 of every flow [F, L, 2].
    """

    fit: LeastSquares
    estimate: Estimate
    I0: str
    reason: str | None
    slopes: Float64

    def moved(self, flow: int, changes: Mapping[str, float]) -> dict[str, float]:
        """Changes of the free parameters, by those of mu_s and mu_2 of a flow."""
        found = self.slopes[flow] @ np.array([changes[name] for name in DEFAULT.free])
        return dict(zip(self.estimate.parameters, found.tolist(), strict=True))


def known_of(result: Result) -> Known:
    """What the fit of a flow knows of its accuracy; without error bars the grains may be real.

    Raises:
        CannotGoOn: it does not know its accuracy.
    """
    bars, I_range = result.error_bars, result.law.I_range
    if (
        result.residuals is None
        or I_range is None
        or result.no_law
        or result.law.name != DEFAULT.name
    ):
        raise CannotGoOn(
            f"{result.input.name} does not determine mu(I): {result.no_law or result.law.reason}; "
            "leave it out"
        )
    mu_s, mu_2, I0 = result.theta
    real = bars is None or bars.grains is not None
    return error_bars.known_of(result, ends_of(I_range, I0), (mu_s, mu_2), real)


def one_law(results: Sequence[Result]) -> OneLaw:
    """The law of all flows from their fits, which have one I0.

    I0 is identified if the flows determine it. An I0 in the settings that is not the usual one is
    given, and stays as it is.

    Raises:
        CannotGoOn: a fit does not know its accuracy.
    """
    flows, usual = list(map(known_of, results)), DEFAULT.parameter("I0").start
    I0 = results[0].parameters["I0"].value
    data, law = _gathered(results, flows, I0_free=False), DEFAULT
    words = f"I0 is held at {I0:g}, as given"
    if usual == I0:
        wide, wider = _gathered(results, flows, I0_free=True), DEFAULT.with_free({"I0": I0})
        words = f"I0 is held at {I0:g}: "
        unknown = [f for f, r in zip(flows, results, strict=True) if points_of(r) is None]
        if (reason := too_noisy(unknown)) is not None:
            words += reason
        elif np.linalg.matrix_rank(wider.by_parameters(wide.I, results[0].theta)) < 3:
            words += "all flows have the same range of I"
        else:
            found = fit(wide, wider, results[0].theta)
            C = found.J @ wide.C @ found.J.T
            share = float(np.sqrt(C[-1, -1])) / found.theta[-1]
            left = f"the flows leave a standard deviation of {100 * share:.2g} %"
            if share > LARGEST["I0"]:
                words += left
            else:
                data, law, words = wide, wider, f"I0 is identified: {left}"
    if law is DEFAULT:
        found = fit(data, law, results[0].theta)
    values = dict(zip(law.free, (found.theta[law.names.index(n)] for n in law.free), strict=True))
    outside = [words for r in results if r.error_bars for words in r.error_bars.outside]
    if any(flow.real for flow in flows):
        outside.insert(0, "several flows of grains with one law")
    of_theta = {name: found.J @ part @ found.J.T for name, part in data.parts.items()}
    estimate = bars_of(values, of_theta, load(), list(dict.fromkeys(outside)))
    of_points = np.split(found.J, np.cumsum(data.points)[:-1], axis=1)
    slopes = np.stack(
        [
            J @ part @ flow.slopes
            for J, part, flow in zip(of_points, data.by_ends, flows, strict=True)
        ]
    )
    lacking = (f"{r.input.name}: {r.law.reason}" for r in results if r.error_bars is None)
    return OneLaw(found, estimate, words, next(lacking, None), slopes)


class Gathered(NamedTuple):
    """What all F flows say of one law.

    Attributes:
        I, y: inertial numbers and log mu there [n].
        parts: covariances of the errors of y, by their cause [n, n].
        by_ends: errors of y of each flow by those at both ends of its range of I.
    """

    I: Float64
    y: Float64
    parts: dict[str, Float64]
    by_ends: list[Float64]

    @property
    def points(self) -> list[int]:
        """How many of the n are of each flow [F]."""
        return list(map(len, self.by_ends))

    @property
    def C(self) -> Float64:
        """Covariance of all errors [n, n]."""
        return np.asarray(sum(self.parts.values()))


def points_of(result: Result) -> LawPoints | None:
    """The law of a flow with I0 free, where the fit knows it."""
    check: Any = result.checks.get("unknown_I0")
    return getattr(check, "points", None)


def _gathered(results: Sequence[Result], flows: Sequence[Known], I0_free: bool) -> Gathered:
    I, y, by_ends, own = [], [], [], []
    for flow, result in zip(flows, results, strict=True):
        assert result.law.I_range is not None
        points = points_of(result) if I0_free else None
        if points is None:
            I.append(np.array(result.law.I_range))
            y.append(np.log(flow.ends))
            own.append(np.zeros((2, 2)))
        else:
            I.append(np.array(points.I))
            y.append(np.array(points.log_mu))
            own.append(np.array(points.covariance))
        by_ends.append(between(I[-1], result.law.I_range))
    J = scipy.linalg.block_diag(*by_ends)
    parts = dict(zip(("method", "grains"), load().of_flows(flows), strict=True))
    others = {
        "scatter": [scatter(r.members, DEFAULT.free) for r in results if r.members],
        "assumptions": [covariance(r.assumptions, DEFAULT.free) for r in results],
    }
    for name, own_parts in others.items():
        pairs = zip(flows, own_parts, strict=True)
        parts[name] = scipy.linalg.block_diag(
            *(flow.slopes @ C @ flow.slopes.T for flow, C in pairs)
        )
    parts = {name: J @ part @ J.T for name, part in parts.items()}
    parts["method"] += scipy.linalg.block_diag(*own)
    return Gathered(np.concatenate(I), np.concatenate(y), parts, by_ends)


class LeastSquares(NamedTuple):
    """The law that fits log mu of all flows best, and their scatter around it.

    Attributes:
        theta: mu_s, mu_2 and I0.
        J: errors of its L free parameters by those of log mu [L, n].
        p_value: the share of draws from the errors with a larger chi-square.
    """

    theta: tuple[float, ...]
    J: Float64
    chi_square: float
    freedom: int
    p_value: float


def fit(data: Gathered, law: FrictionLaw, theta: Sequence[float]) -> LeastSquares:
    """The law mu(I) that fits log mu best, its free parameters from the values theta on."""
    white = np.linalg.inv(np.linalg.cholesky(data.C))
    free = [law.names.index(name) for name in law.free]
    mu_s, mu_2, I0 = theta
    # Two I0 can give a curve the same curvature.
    starts = STARTS if "I0" in law.free else (1.0,)
    found = [_descend(data, white, law, (mu_s, mu_2, factor * I0)) for factor in starts]
    value, at, J, basis = min(found, key=itemgetter(0))
    rng, n, freedom = np.random.default_rng(SEED), len(data.y), load().freedom
    scale = np.sqrt(freedom / rng.chisquare(freedom, (DRAWS, len(data.points))))
    drawn = rng.standard_normal((DRAWS, n)) * np.repeat(scale, data.points, axis=1)
    drawn -= (drawn @ basis) @ basis.T
    above = int(np.count_nonzero(np.sum(drawn**2, axis=1) >= value))
    return LeastSquares(tuple(at.tolist()), J, value, n - len(free), (1 + above) / (1 + DRAWS))


def _descend(
    data: Gathered, white: Float64, law: FrictionLaw, theta: Sequence[float]
) -> tuple[float, Float64, Float64, Float64]:
    """Chi-square of the law nearest to theta, the law, its errors by those of y, and a basis."""
    free = [law.names.index(name) for name in law.free]
    mu_s, mu_2, I0 = theta
    q = np.log([mu_s, mu_2 - mu_s, I0])
    for _ in range(STEPS):
        mu_s, rise, I0 = np.exp(q)
        at = np.array([mu_s, mu_s + rise, I0])
        mu = law.friction(data.I, *at)
        slopes = law.by_parameters(data.I, at) / mu[:, None]
        rest = white @ (data.y - np.log(mu))
        by_q = slopes @ np.array([[mu_s, 0, 0], [mu_s, rise, 0], [0, 0, I0]])
        step = np.linalg.lstsq(white @ by_q[:, free], rest, rcond=None)[0]
        q[free] += np.clip(step, -LONGEST, LONGEST)
    basis, triangle = np.linalg.qr(white @ slopes[:, free])
    J = np.asarray(np.linalg.solve(triangle, basis.T @ white))
    return float(np.sum((rest - basis @ (basis.T @ rest)) ** 2)), at, J, basis
