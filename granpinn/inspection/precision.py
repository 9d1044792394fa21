r"""Expected standard deviations of the parameters of a friction law.

Friction acts where the material shears: a change by $\delta\mu$ changes the velocity of a vector by
about $\kappa H_0 \dot\gamma\,\delta\mu$. N independent vectors with noise $\sigma$ then carry the
Fisher information

$$ F_{ij} = \frac{\kappa^2 H_0^2}{\sigma^2} \sum_{n=1}^{N} \min(\dot\gamma_n, \dot\gamma_{max})^2\,
   \partial_i\mu(I_n)\,\partial_j\mu(I_n), $$

which is that of the residual $\dot\gamma\,s - 2\mu D$ with a strain-rate error of
$\sigma / (\kappa H_0)$. With a cohesion c, $\partial_i\mu$ is $\mu\,\partial_i\ln(c + \mu p)$.
$F^{-1}$ bounds the covariance. The cap $\dot\gamma_{max}$ stands for
layers that are thinner than the region in which a change of friction moves the grains.

$\kappa$ and the cap are calibrated on the bounds of a forward model for two column collapses of
mu(I), (mu_s, mu_2) = (0.2, 0.44) and (0.6, 0.84), with noise of 2 and of 20 %. They reproduce its
standard deviations within a factor 1.25. They are not measured for other flows and laws. The error
of a training is larger than the bound: the error model expects it (uncertainty/error_model.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from granpinn.arrays import Float64
from granpinn.inspection import AssumedLaw, Inspection
from granpinn.inspection.inertial_number import shear_of
from granpinn.physics.laws import mu_of_i
from granpinn.physics.rheology import by_parameters
from granpinn.results.record import ADVICE, Check, Reason, Record
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import Known, ends_of

KAPPA = 0.097
LARGEST_RATE = 15.0  # sqrt(|g| / H0)
LARGEST_CONDITION = 1e12
# With a smaller share or number of flowing vectors, no precision is estimated.
LEAST_FLOWING, FEWEST_FLOWING = 0.01, 200
POOR_REACH = 0.3  # I (95 %) / I0 below which mu_2 is an extrapolation
CORRELATED = 0.9  # mu_2 and I0
GOOD = 0.03  # standard deviation of a parameter
LIMITED = 1.2  # times the standard deviation without noise: noise limits the precision


@dataclass(frozen=True)
class Bounds:
    """Relative standard deviations from noise, by the names of parameters.

    Attributes:
        known: with the parameters known that the law has fixed.
        unknown: with all parameters unknown; empty if the data do not fix all.
        correlation: of the last free and the first fixed parameter (mu_2 and I0) when all are
            unknown; None if the law fixes none, or the data do not fix all.
        independent_vectors: that flow.
    """

    known: dict[str, float]
    unknown: dict[str, float]
    correlation: float | None
    independent_vectors: float


@dataclass(frozen=True)
class Precision(Record):
    """
    Attributes:
        reason: why no precision can be given.
        bounds: from noise alone.
        expected: relative standard deviations after a training, by the names of parameters.
        without_noise: the same without the noise.
        negligible: whether the noise is.
        sentence: the answer of the inspection.
    """

    title = "expected sd"

    reason: str | None
    sentence: str
    bounds: Bounds | None = None
    expected: dict[str, float] | None = None
    without_noise: dict[str, float] | None = None
    negligible: bool = False

    @property
    def words(self) -> str:
        if self.bounds is None:
            return "none"
        if self.negligible:
            return "noise is negligible: only the scatter of a training limits the precision"
        known, unknown = self.bounds.known, self.bounds.unknown
        text = "noise alone: " + ", ".join(f"{name} {sd:.2%}" for name, sd in known.items())
        fixed = [name for name in unknown if name not in known]
        if fixed:
            free = [f"{unknown[name]:.2%}" for name in known]
            free += [f"{name} {unknown[name]:.2%}" for name in fixed]
            text += f"; {' and '.join(fixed)} free: {', '.join(free)}"
        return text

    def reasons(self, of: Inspection) -> list[Reason]:
        if self.bounds is None:
            return []
        found, sd, without = [], self.expected or {}, self.without_noise or {}
        excess = {name: sd[name] / without[name] for name in sd if sd[name] > GOOD}
        name = max(excess, key=lambda name: excess[name], default="")
        if not self.negligible and excess and excess[name] > LIMITED:
            found.append(
                f"Noise limits {name}: without it about {without[name]:.1%} are expected in place "
                f"of {sd[name]:.1%}. More independent vectors, or less noise, help."
            )
        numbers = of.records.get("inertial_number")
        if of.law.law == mu_of_i.LAW.name and numbers is not None:  # the only law with an I0
            reach, correlation = of["inertial_number"].reach, self.bounds.correlation or 0.0
            if reach < POOR_REACH:
                found.append(
                    f"I reaches only {of['inertial_number'].q95:.2g} (95 %) of I0 = {of.law.I0:g}: "
                    "mu_2 cannot be separated from I0; only the slope (mu_2 - mu_s) / I0 is "
                    "measured. Larger grains, a taller column or a steeper slope reach higher I."
                )
            elif correlation > CORRELATED:
                found.append(
                    f"mu_2 and I0 cannot both be found (correlation {correlation:.2f}): give I0, "
                    "or trust the law over the covered I only."
                )
        return [Reason(ADVICE, text) for text in found]


def make(inspection: Inspection) -> Precision:
    bounds = bounds_of(inspection)
    if isinstance(bounds, str):
        return Precision(bounds, f"No precision can be given: {bounds}.")
    law = inspection.law.friction_law
    sd, without = (expected(inspection, bounds, noise) for noise in (1.0, 0.0))
    level = "V0" if inspection.flow.surface is None else "V1"
    known = "".join(f", {name} known" for name in law.names if name not in law.free)
    about = " and ".join(f"{name} to {value:.1%}" for name, value in sd.items())
    if law.curve:
        ends = f"{min(sd.values()):.1%} to {max(sd.values()):.1%}"
        about = f"{law.curve[0]} to {law.curve[-1]} to {ends}"
    grains = "" if inspection.flow.of_solver else ", with what real grains depart from a law"
    sure = f"one standard deviation{known}{grains}"
    sentence = f"Expected of a training at level {level}: {about} ({sure})."
    negligible = inspection["noise"].negligible
    return Precision(None, sentence, bounds, sd, without, negligible)


def bounds_of(inspection: Inspection) -> Bounds | str:
    """The bounds from noise, or the reason why there are none."""
    if inspection.undetermined is not None:
        return inspection.undetermined
    found, numbers, noise = inspection.facts.slopes, inspection.inertia, inspection.facts.noise
    flows = numbers.flows
    moving, total = float(found.vectors[flows].sum()), float(found.vectors.sum())
    if noise.sigma is None:
        return "the noise cannot be estimated from so few vectors"
    if moving < max(LEAST_FLOWING * total, FEWEST_FLOWING):
        share = 100 * moving / total if total else 0.0
        return (
            f"the grains hardly shear ({share:.1f} % of the vectors flow measurably), and friction "
            "shows only where they do"
        )
    vectors = found.vectors[flows] / noise.vectors_per_independent
    p = numbers.p[flows] * inspection.scales.pressure
    shear = found.gamma_dot[flows], numbers.I[flows]
    bounds = expected_precision(*shear, vectors, noise.sigma, inspection.law, p)
    return bounds or "all vectors have nearly the same inertial number, which fixes no law"


def expected(inspection: Inspection, bounds: Bounds, noise: float = 1.0) -> dict[str, float]:
    """Relative standard deviations of the parameters after a training, by name.

    Those of mu(I) are the error bars of the error model for a good fit. For another law it is the
    larger error of mu at either end of the range of I, beside the bound by noise. The friction of
    the assumed law at both ends is continued as that of mu(I).

    Args:
        noise: over that of the data.
    """
    shear, law, slopes = shear_of(inspection), inspection.law, inspection.facts.slopes
    if shear is None:
        return {}
    I0 = law.inertial_scale or mu_of_i.LAW.parameter("I0").start
    x = ends_of((shear.low, shear.high), I0)
    mu = law.friction_law.friction(np.array([shear.low, shear.high]), *law.theta)
    mu_s, mu_2 = np.linalg.solve(error_model.line(x), mu * np.ones(2)).tolist()
    speed = float(np.sqrt(np.mean(np.hypot(slopes.u, slopes.v) ** 2)))
    misfit = noise * (inspection.facts.noise.sigma or 0.0) * math.sqrt(2) / speed
    vectors = bounds.independent_vectors
    known = Known(x, (mu_s, mu_2), misfit=misfit, noise=misfit, vectors=vectors)
    flow, model = inspection.flow, error_model.load()
    known = known._replace(outline=flow.surface is None, real=not flow.of_solver)
    if law.law == mu_of_i.LAW.name:
        return {n: sd / known.parameters[n] for n, sd in error_bars.sd_of([known], model).items()}
    most = math.sqrt(np.diag(model.method(known) + model.grains(known)).max())
    return {name: math.hypot(noise * sd, most) for name, sd in bounds.known.items()}


def sensitivities(I: Float64, law: AssumedLaw, p: Float64 | None = None) -> Float64:
    """Derivatives of mu(I) with respect to all N parameters of the law: [K, N].

    With a cohesion: of the logarithm of the yield stress, times mu.

    Args:
        p: pressure in the unit of a cohesion [K]; laws without cohesion do not need it.
    """
    if law.friction_law.cohesion is None:
        return by_parameters(law.friction_law, I, law.theta)

    def logarithm(mu: Tensor, theta: Tensor) -> Tensor:
        stress = law.friction_law.cohesion_of(theta) + mu * torch.as_tensor(p)
        found: Tensor = mu.detach() * stress.log()
        return found

    return by_parameters(law.friction_law, I, law.theta, logarithm)


def expected_precision(
    gamma_dot: Float64,
    I: Float64,
    vectors: Float64,
    sigma: float,
    law: AssumedLaw,
    p: Float64 | None = None,
) -> Bounds | None:
    """Standard deviations for data of K cells that flow; None if the data do not fix the law.

    Args:
        gamma_dot, I: shear rate and inertial number [K], dimensionless.
        vectors: independent vectors in every cell [K].
        sigma: noise of one component, dimensionless.
        p: as for `sensitivities`.
    """
    J = sensitivities(I, law, p)
    weight = vectors * (KAPPA * np.minimum(gamma_dot, LARGEST_RATE)) ** 2
    information = np.einsum("k,ki,kj->ij", weight, J, J)
    relative = information * np.outer(law.theta, law.theta)  # for logarithms of the parameters
    parameters = law.friction_law.parameters
    fixed = [k for k, p in enumerate(parameters) if p.fixed]
    free = [k for k, p in enumerate(parameters) if not p.fixed]
    of_free = relative[np.ix_(free, free)]
    if not np.linalg.cond(of_free) < LARGEST_CONDITION:
        return None
    sd = sigma * np.sqrt(np.diag(np.linalg.inv(of_free)))
    bounds = dict(zip(law.friction_law.free, map(float, sd), strict=True))
    unknown: dict[str, float] = {}
    correlation = None
    if np.linalg.cond(relative) < LARGEST_CONDITION:
        covariance = np.linalg.inv(relative)
        sd = sigma * np.sqrt(np.diag(covariance))
        unknown = {p.name: float(s) for p, s in zip(parameters, sd, strict=True)}
        if fixed:
            i, j = free[-1], fixed[0]
            correlation = float(covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j]))
    return Bounds(bounds, unknown, correlation, float(vectors.sum()))


CHECK = Check("precision", Precision, make, seconds=0.3, quick=False)
