r"""Does one friction law hold on all parts of the data?

The law is solved for on both halves of every split (granpinn/training/parts.py). Parameters trade
off, so the curves are compared over the I that both halves hold. The relative difference
$\delta(I) = \mu''/\mu' - 1$ has the variance

$$ \sigma^2 = \sigma_r^2 + \sigma_m^2. $$

$\sigma_r$ comes from the residuals: correlated residuals by boxes, the larger of two sizes.
$\sigma_m$ is the further error of halves. Simulated collapses of one law show it (calibration.py):
halves of them share most of the error of their law. It is stated where $\sigma_r$ is least, and has
the shape of $\sigma_r$ over I. Flows of grains add the usual error $\sigma_k$ of mu of their kind,
$\sigma_k^2 (1/f_1 + 1/f_2)$: if it came from the parts independently, a part with the share f of
what the data tell would have the error $\sigma_k / \sqrt f$. In trainings that differ from those of
the study of halves the error of mu(I) counts by the same rule, if it is larger. It alone would be
too small at some I: the errors of one simulator cross zero there, those of other data need not.

Parts differ if anywhere

$$ |\delta(I)| > \sigma(I) \sqrt{L\, F_{L,\nu}(1 - \alpha)}, $$

the simultaneous band of Scheffe (1953) of a curve with L free parameters: parts with the same
friction in the middle may have curves of different slopes. With n splits $\alpha$ is LEVEL / n
(Bonferroni): data of one law have any difference with a probability of at most LEVEL. The degrees
of freedom of $\sigma_r$ are the effective number of small boxes,
$(\sum_B \psi_B^2)^2 / \sum_B \psi_B^4$ for their contributions $\psi_B$.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.physics.laws import LAWS, Law, mu_of_i
from granpinn.physics.rheology import by_parameters
from granpinn.results import Result
from granpinn.results.parts import SPLITS, Part, Parts, Split
from granpinn.results.records import Verdict
from granpinn.training.parts import HalfLaws
from granpinn.uncertainty import calibration
from granpinn.uncertainty.calibration import Calibration
from granpinn.uncertainty.of_law import velocity_error
from granpinn.uncertainty.of_training import uncalibrated

LEVEL = 0.05
CURVE = 41  # inertial numbers at which the curves are compared, evenly in log I
SLOW = 0.01  # of the smallest I: there mu is that of the slowest grains, mu_s in the table
TELLING = 0.15  # a limit above this says nothing about the law
COLLAPSE = "collapse"


class Variance(NamedTuple):
    """Variances at some I [n], and their degrees of freedom, a number or [n]."""

    value: Float64
    freedom: float | Float64


class Place(NamedTuple):
    """Where laws are compared.

    Attributes:
        I: inertial numbers [n].
        mu: friction there [n].
        xi: -1 at the 5th to +1 at the 95th percentile of I of the data [n], linear in I/(I + I0).
        slow: friction of the slowest grains.
        I0: of mu(I).
    """

    I: Float64  # noqa: E741
    mu: Float64
    xi: Float64
    slow: float
    I0: float


def of_halves(
    table: Calibration,
    kind: str | None,
    at: Place,
    split: str,
    residuals: Float64,
    parts: float,
    alike: bool = True,
) -> list[Variance] | None:
    """Variances of the difference between two halves, beyond that of the residuals.

    Args:
        kind: of_kind.kind_of.
        split: its name.
        residuals: variance by the residuals at every I [n].
        parts: sum of 1/f over both parts.
        alike: whether the training is like those of the study of halves.

    Returns:
        None without data on this kind.
    """
    found = []
    if kind is not None:
        if kind not in table.model_error:
            return None
        entry = table.model_error[kind]
        value = parts * (entry.level**2 + (entry.tilt * at.xi) ** 2)
        found.append(Variance(value, entry.flows))
    if kind not in (None, COLLAPSE):
        return found
    whole = Variance(parts * error_of_collapses(table, at), table.discrepancy_weight)
    if table.halves is None:
        return [*found, whole]
    shape = residuals / max(float(residuals.min()), 1e-300)
    own = Variance(table.halves.sd[split] ** 2 * shape, table.halves.flows)
    if not alike:
        own = Variance(np.maximum(own.value, whole.value), whole.freedom)
    return [*found, own]


def error_of_collapses(table: Calibration, at: Place) -> Float64:
    r"""Relative variance of mu by a law of all data, in simulated collapses.

    It is that of mu(I) with the covariance D of the errors of (mu_s, mu_2) / mu_s in the table,
    $(\mu_s/\mu)^2 J D J^T$ with J = (1 - x, x), x = I / (I + I0). A mu_s beyond the materials of
    the table counts as that of the nearest one.
    """
    x = at.I / (at.I + at.I0)
    J = np.stack([1 - x, x], 1)
    slow = np.minimum(np.clip(at.slow, *table.valid_mu_s), at.mu)
    D = table.discrepancy_at(float(np.clip(at.slow, *table.valid_mu_s)), table.steps)
    return np.asarray(np.einsum("ni,ij,nj->n", J, D, J) * (slow / at.mu) ** 2)


def compared(
    halves: Sequence[HalfLaws], law: Law, table: Calibration, kind: str | None, alike: bool = True
) -> Parts:
    """The differences between the laws on parts of the data; arguments as of `of_halves`."""
    splits = tuple(_split(h, law, table, kind, LEVEL / len(halves), alike) for h in halves)
    return Parts(LEVEL, splits)


def _split(
    halves: HalfLaws, law: Law, table: Calibration, kind: str | None, level: float, alike: bool
) -> Split:
    theta, ranges = halves.theta.cpu().numpy(), halves.I.cpu().numpy()
    share = halves.share.cpu().numpy()
    parts = [
        Part(
            name, dict(zip(law.names, t.tolist(), strict=True)), float(r[0]), float(r[1]), float(f)
        )
        for name, t, r, f in zip(SPLITS[halves.name], theta, ranges, share, strict=True)
    ]
    both = parts[0], parts[1]
    low, high = float(ranges[:, 0].max()), float(ranges[:, 1].min())
    if not 0 < low < high:
        return Split(halves.name, both)
    I = np.geomspace(low, high, CURVE)  # noqa: E741
    mu = np.stack([np.broadcast_to(law.friction(I, *t), I.shape) for t in theta])
    if not np.isfinite(mu).all() or (mu <= 0).any():
        return Split(halves.name, both)
    free = [k for k, p in enumerate(law.parameters) if not p.fixed]
    slopes = [by_parameters(law, I, t)[:, free] for t in theta]
    of_boxes = [_spread(boxes.cpu().numpy(), mu, slopes) for boxes in halves.influence]
    known = [Variance(np.max([v for v, _ in of_boxes], axis=0), of_boxes[0][1])]
    best = int(np.argmin(known[0].value))
    at = _place(law, theta.mean(0), I, ranges)
    parts_of_data = float(np.sum(1 / share))
    model = of_halves(table, kind, at, halves.name, known[0].value, parts_of_data, alike)
    known += model or ()
    total = sum(part.value for part in known)
    percent, std = 100 * (mu[1] / mu[0] - 1), 100 * np.sqrt(total)
    if model is None:
        return Split(halves.name, both, *(float(a[best]) for a in (I, percent, std)))
    usual = 100 * np.sqrt(sum(part.value for part in model))
    squares = sum(part.value**2 / part.freedom for part in known)
    freedom = np.maximum(total**2 / np.maximum(squares, 1e-300), 1.0)
    L = halves.influence[0].shape[-1]
    limit = std * np.sqrt(L * special.fdtri(L, freedom, 1 - level))
    ratio = np.abs(percent) / np.maximum(limit, 1e-300)
    k = int(np.argmax(ratio)) if ratio.max() > 1 else best
    return Split(halves.name, both, *(float(a[k]) for a in (I, percent, std, usual, limit)))


def _place(law: Law, theta: Float64, I: Float64, ranges: Float64) -> Place:  # noqa: E741
    slow = law.friction(np.array([SLOW * ranges.min()]), *theta) * np.ones(1)
    known = dict(zip(law.names, theta.tolist(), strict=True))
    scale = law.inertial_scale
    I0 = mu_of_i.LAW.parameter("I0").typical if scale is None else known[scale]
    x, first, last = (a / (a + I0) for a in (I, ranges.min(), ranges.max()))
    xi = np.clip(2 * (x - first) / (last - first) - 1, -1, 1)
    mu = np.broadcast_to(law.friction(I, *theta), I.shape)
    return Place(I, mu, xi, float(slow[0]), I0)


def _spread(boxes: Float64, mu: Float64, slopes: Sequence[Float64]) -> tuple[Float64, Float64]:
    """Variance of delta at every I [n], and its degrees of freedom [n].

    Args:
        boxes: influence of every box on the free parameters of both halves [B, 2, L].
        mu: of both halves at every I [2, n].
        slopes: derivatives of mu by the free parameters, of both halves [n, L].
    """
    ratio = mu[1] / mu[0]
    psi = np.zeros((len(boxes), mu.shape[1]))
    for half, sign in ((0, -1.0), (1, 1.0)):
        psi += sign * ratio * (boxes[:, half] @ slopes[half].T) / mu[half]
    squares = (psi**2).sum(0)
    return squares, np.maximum(squares**2 / np.maximum((psi**4).sum(0), 1e-300), 1.0)


def judged(
    result: Result, halves: Sequence[HalfLaws], config: Config, kind: str | None, noise: float
) -> Result:
    """The result with the laws on halves of its data, and their answer in its verdict.

    Args:
        kind: of the flow (of_kind.kind_of).
        noise: of the vectors over the rms speed.
    """
    table = calibration.of_level(config.level) or calibration.load()
    if not halves or result.residuals is None:
        return result
    known = table.halves is not None and table.halves.holds(noise, result.timing.steps)
    alike = known and not uncalibrated(config)
    parts = compared(halves, LAWS[result.law.name], table, kind, alike)
    resolved = velocity_error(result.residuals, table) <= table.largest_misfit
    return dataclasses.replace(
        result, parts=parts, verdict=verdict(result.verdict, parts, LAWS[result.law.name], resolved)
    )


def verdict(before: Verdict | None, parts: Parts, law: Law, resolved: bool) -> Verdict | None:
    """The verdict of the residuals with the answer of the parts.

    Parts that differ contradict the law. Where the velocity is too noisy for the residuals, parts
    that agree to within `TELLING` of the friction are the answer.

    Args:
        resolved: whether the residuals can test the law.
    """
    ratios = {} if before is None else before.ratios
    if parts.different:
        return Verdict(False, f"these data do not follow one law: {parts}", ratios)
    limit = parts.largest_limit
    if before is None or limit is None:
        return before
    if before.follows is None and not resolved and limit <= 100 * TELLING:
        words = f"nothing contradicts {law.title}: {parts}"
        return Verdict(True, f"{words}; the residuals are too noisy for a test", ratios)
    return dataclasses.replace(before, words=f"{before.words}; {parts}")
