r"""One friction law of several flows of one material: the fit to the laws of the single flows.

The law of flow f by itself gives log mu at both ends of its range of I. With all of them y [2 F],
their errors of covariance C, and one law $\theta$ of L parameters that fits them best,

$$ \chi^2 = \min_\theta\, (y - \log\mu(\theta))^T C^{-1} (y - \log\mu(\theta)). $$

C has every part of the error bars: method, grains, whose level is in part common to all flows
(error_model.py), assumptions, and the scatter over seeds. So every flow counts by its errors. With
the slopes K of log mu by the parameters, the covariance of $\theta$ is $J C J^T$,

$$ J = (K^T C^{-1} K)^{-1} K^T C^{-1} . $$

p is the share of draws from these errors with a larger chi-square. So a p below 0.01 is a false
alarm in 1 % of all groups, as far as the error model is right.

The ends are those of a law with a given I0. Where the ranges of the flows determine I0, it is a
third parameter of the fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.physics.laws import DEFAULT, FrictionLaw
from granpinn.physics.rheology import by_parameters
from granpinn.results import Result
from granpinn.uncertainty.determined import LARGEST
from granpinn.uncertainty.error_bars import Estimate, bars_of, known_by, scatter, sd_of
from granpinn.uncertainty.error_model import Known, ends_of, load
from granpinn.uncertainty.expected import too_noisy
from granpinn.uncertainty.sensitivity import covariance

STEPS_OF_I0 = 100_000  # with them error bars of I0 hold (bench/studies/one_law)
DRAWS, SEED = 20_000, 0
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
    bars, residuals, I_range = result.error_bars, result.residuals, result.law.I_range
    lost = result.determined.reason if result.determined else None
    if residuals is None or I_range is None or lost or result.law.name != DEFAULT.name:
        raise CannotGoOn(
            f"{result.input.name} does not determine mu(I): {lost or result.law.reason}; leave it "
            "out"
        )
    mu_s, mu_2, I0 = result.theta
    return known_by(
        residuals,
        result.data.measured_noise,
        x=ends_of(I_range, I0),
        mu=(mu_s, mu_2),
        vectors=result.data.independent or 1.0,
        steps=result.timing.steps,
        outline=result.level == "V0",
        real=bars is None or bars.grains is not None,
    )


def one_law(results: Sequence[Result]) -> OneLaw:
    """The law of all flows from their fits, which have one I0.

    I0 is identified if the ranges of I determine it and the noise is small. An I0 in the settings
    that is not the usual one is given, and stays as it is.

    Raises:
        CannotGoOn: a fit does not know its accuracy.
    """
    flows, model, usual = list(map(known_of, results)), load(), DEFAULT.parameter("I0").start
    free, I0 = False, results[0].parameters["I0"].value
    if usual != I0:
        words = f"I0 is held at {I0:g}, as given"
    else:
        share = sd_of([flow._replace(I0=I0) for flow in flows], model)["I0"] / I0
        expected = "the expected error of I0 from the ranges of I of all flows is "
        expected += f"{100 * share:.2g} %"
        if share > LARGEST["I0"]:
            words = f"I0 is held at {I0:g}: {expected}"
        elif (reason := too_noisy(flows)) is not None:
            words = f"I0 is held at {I0:g}: {reason}"
        else:
            free, words = True, f"I0 is identified: {expected}"
    parts = dict(zip(("method", "grains"), model.of_flows(flows), strict=True))
    for name, own in (("scatter", _scatter), ("assumptions", _assumptions)):
        at_ends = [f.slopes @ own(r) @ f.slopes.T for f, r in zip(flows, results, strict=True)]
        parts[name] = block_diag(*at_ends)
    I = np.concatenate([r.law.I_range for r in results if r.law.I_range is not None])
    law = DEFAULT.with_free({"I0": I0}) if free else DEFAULT
    y = np.log(np.concatenate([flow.ends for flow in flows]))
    found = fit(y, sum(parts.values(), np.zeros((len(y), len(y)))), I, law, results[0].theta)
    values = dict(zip(law.free, (found.theta[law.names.index(n)] for n in law.free), strict=True))
    outside = [words for r in results if r.error_bars for words in r.error_bars.outside]
    outside = [*_untested(flows, free), *dict.fromkeys(outside)]
    of_theta = {name: found.J @ part @ found.J.T for name, part in parts.items()}
    estimate = bars_of(values, of_theta, model, outside)
    of_ends = np.split(found.J, len(flows), axis=1)
    slopes = np.stack([J @ flow.slopes for J, flow in zip(of_ends, flows, strict=True)])
    lacking = (f"{r.input.name}: {r.law.reason}" for r in results if r.error_bars is None)
    return OneLaw(found, estimate, words, next(lacking, None), slopes)


class LeastSquares(NamedTuple):
    """The law that fits the laws of F flows best, and their scatter around it.

    Attributes:
        theta: mu_s, mu_2 and I0.
        J: errors of its L free parameters by those of log mu at the ends [L, 2 F].
        p_value: the share of draws from the errors with a larger chi-square.
    """

    theta: tuple[float, ...]
    J: Float64
    chi_square: float
    freedom: int
    p_value: float


def fit(
    y: Float64, C: Float64, I: Float64, law: FrictionLaw, theta: Sequence[float]
) -> LeastSquares:
    """The law that fits log mu best.

    Args:
        y: log mu at both ends of the ranges of F flows [2 F].
        C: covariance of its errors [2 F, 2 F].
        I: the ends [2 F].
        law, theta: mu(I), whose free parameters are fitted from these values on.
    """
    white = np.linalg.inv(np.linalg.cholesky(C))
    free = [law.names.index(name) for name in law.free]
    mu_s, mu_2, I0 = theta
    q = np.log([mu_s, mu_2 - mu_s, I0])
    for _ in range(STEPS):
        mu_s, rise, I0 = np.exp(q)
        at = np.array([mu_s, mu_s + rise, I0])
        mu = law.friction(I, *at)
        slopes = by_parameters(law, I, at) / mu[:, None]
        rest = white @ (y - np.log(mu))
        by_q = slopes @ np.array([[mu_s, 0, 0], [mu_s, rise, 0], [0, 0, I0]])
        step = np.linalg.lstsq(white @ by_q[:, free], rest, rcond=None)[0]
        q[free] += np.clip(step, -LONGEST, LONGEST)
    basis, triangle = np.linalg.qr(white @ slopes[:, free])
    value = float(np.sum((rest - basis @ (basis.T @ rest)) ** 2))
    rng, n, freedom = np.random.default_rng(SEED), len(y), load().freedom
    scale = np.sqrt(freedom / rng.chisquare(freedom, (DRAWS, n // 2)))
    drawn = rng.standard_normal((DRAWS, n)) * np.repeat(scale, 2, axis=1)
    drawn -= (drawn @ basis) @ basis.T
    above = int(np.count_nonzero(np.sum(drawn**2, axis=1) >= value))
    J = np.asarray(np.linalg.solve(triangle, basis.T @ white))
    return LeastSquares(tuple(at.tolist()), J, value, n - len(free), (1 + above) / (1 + DRAWS))


def _scatter(result: Result) -> Float64:
    assert result.members is not None
    return scatter(result.members, DEFAULT.free)


def _assumptions(result: Result) -> Float64:
    return covariance(result.assumptions, DEFAULT.free)


def _untested(flows: Sequence[Known], free_I0: bool) -> list[str]:
    """In what no study has tested the error bars of one law, in words."""
    found = ["several flows of grains with one law"] if any(flow.real for flow in flows) else []
    steps = min(flow.steps for flow in flows)
    if free_I0 and steps < STEPS_OF_I0:
        found.append(f"I0 after {steps} steps (tested: {STEPS_OF_I0})")
    return found
