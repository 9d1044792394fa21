r"""The center of an ensemble, and its error bars: the error model, continued to x = 0 and x = 1.

Error bars exist for mu(I) alone.

The covariance of the center of an ensemble has up to four parts,

$$ C = J (M + G) J^T + S / K + A : $$

M is the covariance of the errors of log mu at both ends of the range of I, G that of the departure
of real grains from mu(I) (error_model.py), and J continues the line through both ends. S is the
scatter of K > 1 members over seeds. A is the effect of assumptions, such as the offset of the
surface line (sensitivity.py).

The law of several flows has error bars of the same parts (one_law.py).

Intervals are from Student's distribution and symmetric in log mu, so friction stays positive.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config, flatten
from granpinn.data.symmetry import UNCHANGING
from granpinn.physics.laws import DEFAULT, LAWS, FrictionLaw
from granpinn.physics.terms import LAW, TERMS
from granpinn.results import Covariance, Parameter, Result
from granpinn.results.records import Assumed, ErrorBars, Members
from granpinn.uncertainty.error_model import ErrorModel, Known, Pair, interval, load

DECISIVE = ("form", "units", "network", "rheology", "weights", "batch", "optimizer")


def center(members: Members, law: FrictionLaw = DEFAULT) -> tuple[float, ...]:
    """Medians over the members, in the order of `law.free`.

    If a parameter is optimised as its rise above the one before it, the median is of the rise: the
    data determine the slope of mu(I), not mu_2. The median of the logarithm would be the same.
    """
    values = values_of(members, law.free)
    found: list[float] = []
    for k, name in enumerate(law.free):
        if law.parameter(name).variable == "log_above":
            found.append(found[-1] + float(np.median(values[:, k] - values[:, k - 1])))
        else:
            found.append(float(np.median(values[:, k])))
    return tuple(found)


def most_central(members: Members, law: FrictionLaw) -> int:
    """Index of the member that is nearest to the center.

    The distance is relative to the first parameter of the center, and of a cohesion, which has
    another unit than friction, relative to its own center.
    """
    middle = np.array(center(members, law))
    unit = [middle[k if name == law.cohesion else 0] for k, name in enumerate(law.free)]
    z = (values_of(members, law.free) - middle) / np.array(unit)
    return int(np.argmin((z**2).sum(axis=1)))


def values_of(members: Members, names: Sequence[str]) -> Float64:
    """The values of L parameters of the members [K, L]."""
    return np.stack([members.values[name] for name in names], axis=1)


def known_of(result: Result, x: Pair, mu: Pair, real: bool) -> Known:
    """What a fit knows of its accuracy; its noise is the stated one, or else the measured one.

    Args:
        x, mu, real: as in `Known`.
    """
    residuals, data = result.residuals, result.data
    assert residuals is not None
    return Known(
        x,
        mu,
        misfit=residuals.velocity,
        law=residuals[TERMS[LAW].name],
        noise=residuals.noise or data.measured_noise or 0.0,
        vectors=data.independent or 1.0,
        steps=result.timing.steps,
        outline=result.level == "V0",
        real=real,
    )


class Estimate(NamedTuple):
    """The identified parameters by name, their covariance, and its parts."""

    parameters: dict[str, Parameter]
    covariance: Covariance
    bars: ErrorBars


def estimate(
    members: Members, known: Known, model: ErrorModel, assumed: Sequence[Assumed] = ()
) -> Estimate:
    """Error bars of the center `known.mu` of an ensemble."""
    J, (of_method, of_grains) = continuation([known], model), model.of_flows([known])
    values = known.parameters
    parts = {
        "method": J @ of_method @ J.T,
        "grains": J @ of_grains @ J.T,
        "scatter": scatter(members, tuple(values)),
        "assumptions": covariance(assumed, tuple(values)),
    }
    return bars_of(values, parts, model, model.outside(known))


def bars_of(
    values: Mapping[str, float],
    parts: Mapping[str, Float64],
    model: ErrorModel,
    outside: Sequence[str],
) -> Estimate:
    """The error bars of L parameters.

    Args:
        values: the parameters by name.
        parts: covariances by the names of `ErrorBars` [L, L].
        outside: in what the fits are beyond the error model, in words.
    """
    C = sum(parts.values(), np.zeros((len(values), len(values))))
    half, sd = model.half_width(), np.sqrt(np.diag(C)).tolist()
    parameters = {
        name: Parameter(value, False, s, interval(value, s, half))
        for (name, value), s in zip(values.items(), sd, strict=True)
    }
    others = {n: _sd(part) if part.any() else None for n, part in parts.items() if n != "method"}
    bars = ErrorBars(
        method=_sd(parts["method"]),
        **others,
        freedom=model.freedom,
        half_width=half,
        outside=tuple(outside),
        provenance=model.provenance,
    )
    return Estimate(parameters, Covariance(tuple(values), tuple(map(tuple, C.tolist()))), bars)


def continuation(flows: Sequence[Known], model: ErrorModel) -> Float64:
    """Errors of the L parameters by those of log mu at both ends of F flows [L, 2 F]."""
    slopes = np.concatenate([known.slopes for known in flows])
    if len(slopes) == slopes.shape[1]:
        return np.asarray(np.linalg.inv(slopes))
    method, of_grains = model.of_flows(flows)
    triangle = np.linalg.cholesky(method + of_grains)
    white = np.linalg.solve(triangle, np.eye(len(triangle)))
    return np.asarray(np.linalg.lstsq(white @ slopes, white, rcond=None)[0])


def sd_of(flows: Sequence[Known], model: ErrorModel) -> dict[str, float]:
    """Standard deviations of the parameters in runs of which no more is known.

    Infinite if the ranges of the flows leave one open, as those of one flow that is given twice.
    """
    if np.linalg.matrix_rank(np.concatenate([f.slopes for f in flows])) < len(flows[0].parameters):
        return dict.fromkeys(flows[0].parameters, np.inf)
    J = continuation(flows, model)
    C = J @ sum(model.of_flows(flows)) @ J.T
    return dict(zip(flows[0].parameters, _sd(C), strict=True))


def scatter(members: Members, names: Sequence[str]) -> Float64:
    """Covariance of the mean of L parameters over the members [L, L]; 0 for one member."""
    values = values_of(members, names)
    K = len(values)
    if K < 2:
        return np.zeros((len(names), len(names)))
    return np.asarray(np.cov(values, rowvar=False) / K)


def covariance(assumed: Sequence[Assumed], names: Sequence[str]) -> Float64:
    """The sum of sd^2 (d theta / d a)(d theta / d a)^T over assumptions, [L, L]."""
    total = np.zeros((len(names), len(names)))
    for a in assumed:
        if a.derivative is not None:
            change = a.sd * np.array([a.derivative[name] for name in names])
            total += np.outer(change, change)
    return total


def _sd(C: Float64) -> tuple[float, ...]:
    """Standard deviations."""
    return tuple(np.sqrt(np.diag(C)).tolist())


def judge(
    result: Result, known: Known | None, config: Config, assumed: Sequence[Assumed] = ()
) -> Estimate | str:
    """The error bars of a training, or why it has none.

    Args:
        known: what the run knows of its accuracy; None: no grains shear, or another law.
        assumed: assumptions whose effect enters the error bars.
    """
    if result.failure is not None or result.residuals is None:
        return "the training diverged"
    if LAWS[config.law] is not DEFAULT:
        return f"there are error bars for {DEFAULT.title} only"
    if changed := untested(config):
        return (
            f"the error bars are those of the default recipe, and this run has another "
            f"{', '.join(changed)}"
        )
    if known is None:
        return "no grains shear"
    if missing := [a.name for a in assumed if a.derivative is None]:
        return f"the effect of the {' and '.join(missing)} is not known"
    assert result.members is not None
    found = estimate(result.members, known, load(), assumed)
    if known.real:
        return found
    # Grains of all kinds were tested, of simulated flows those that change in time.
    said = result.data.symmetries
    unlike = tuple(f"a flow that is {w.partition(':')[0]}" for w in said if w == UNCHANGING)
    bars = dataclasses.replace(found.bars, outside=(*unlike, *found.bars.outside))
    return found._replace(bars=bars)


def untested(config: Config) -> list[str]:
    """Names of the settings that differ from those that the error model was made with."""
    usual, own = flatten(Config()), flatten(config)
    decisive = [key for key in usual if key.split(".")[0] in DECISIVE]
    no_influence = "rheology.random_start"  # bench/studies/ablation
    return [key for key in decisive if own[key] != usual[key] and key != no_influence]
