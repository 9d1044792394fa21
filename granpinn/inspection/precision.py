"""Expected standard deviations of the parameters of a friction law.

They are those of the error model for a good fit (uncertainty/error_model.py), from the range of I
of the flow, the noise of its vectors and their number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.inspection import Inspection
from granpinn.inspection.inertial_number import shear_of
from granpinn.physics.laws import mu_of_i
from granpinn.results.record import ADVICE, Check, Reason, Record
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import Known, ends_of

# With a smaller share or number of flowing vectors, no precision is estimated.
LEAST_FLOWING, FEWEST_FLOWING = 0.01, 200
GOOD = 0.03  # standard deviation of a parameter
LIMITED = 1.2  # times the standard deviation without noise: noise limits the precision


@dataclass(frozen=True)
class Precision(Record):
    """
    Attributes:
        reason: why no precision can be given.
        sentence: the answer of the inspection.
        expected: relative standard deviations after a training, by the names of parameters.
        without_noise: the same without the noise.
        negligible: whether the noise is.
    """

    title = "expected sd"

    reason: str | None
    sentence: str
    expected: dict[str, float] | None = None
    without_noise: dict[str, float] | None = None
    negligible: bool = False

    @property
    def words(self) -> str:
        if not self.expected or not self.without_noise:
            return "none"
        if self.negligible:
            return "noise is negligible: only the scatter of a training limits the precision"
        noisy, without = (
            ", ".join(f"{name} {sd:.2%}" for name, sd in parts.items())
            for parts in (self.expected, self.without_noise)
        )
        return f"{noisy}; without noise: {without}"

    def reasons(self, of: Inspection) -> list[Reason]:
        if not self.expected or not self.without_noise:
            return []
        found, sd, without = [], self.expected, self.without_noise
        excess = {name: sd[name] / without[name] for name in sd if sd[name] > GOOD}
        name = max(excess, key=lambda name: excess[name], default="")
        if not self.negligible and excess and excess[name] > LIMITED:
            found.append(
                f"Noise limits {name}: without it about {without[name]:.1%} are expected in place "
                f"of {sd[name]:.1%}. More independent vectors, or less noise, help."
            )
        return [Reason(ADVICE, text) for text in found]


def make(inspection: Inspection) -> Precision:
    why = impossible(inspection)
    sd, without = ({}, {}) if why else (expected(inspection, noise) for noise in (1.0, 0.0))
    if not sd:
        why = why or "all vectors have nearly the same inertial number, which fixes no law"
        return Precision(why, f"No precision can be given: {why}.")
    law = inspection.law.friction_law
    level = "V0" if inspection.flow.surface is None else "V1"
    known = "".join(f", {name} known" for name in law.names if name not in law.free)
    about = " and ".join(f"{name} to {value:.1%}" for name, value in sd.items())
    if law.curve:
        about = f"{law.curve[0]} to {law.curve[-1]} to {sd[law.curve[0]]:.1%}"
    grains = "" if inspection.flow.of_solver else ", with what real grains depart from a law"
    sure = f"one standard deviation{known}{grains}"
    sentence = f"Expected of a training at level {level}: {about} ({sure})."
    return Precision(None, sentence, sd, without, inspection["noise"].negligible)


def impossible(inspection: Inspection) -> str | None:
    """The reason why no precision can be given; None if it can."""
    if inspection.undetermined is not None:
        return inspection.undetermined
    if inspection.facts.noise.sigma is None:
        return "the noise cannot be estimated from so few vectors"
    vectors = inspection.inertia.vectors
    moving, total = float(vectors[inspection.inertia.flows].sum()), float(vectors.sum())
    if moving >= max(LEAST_FLOWING * total, FEWEST_FLOWING):
        return None
    share = 100 * moving / total if total else 0.0
    return (
        f"the grains hardly shear ({share:.1f} % of the vectors flow measurably), and friction "
        "shows only where they do"
    )


def expected(inspection: Inspection, noise: float = 1.0) -> dict[str, float]:
    """Relative standard deviations of the parameters after a training, by name.

    Those of mu(I) are the error bars of the error model for a good fit, without parameters that the
    range of I does not determine. For another law it is the larger error of mu at either end of the
    range of I; a cohesion has none. The friction of the assumed law at both ends is continued as
    that of mu(I).

    Args:
        noise: over that of the data.
    """
    shear, law, facts = shear_of(inspection), inspection.law, inspection.facts
    if shear is None:
        return {}
    I0 = law.inertial_scale or mu_of_i.LAW.parameter("I0").start
    x = ends_of(shear, I0)
    mu = law.friction_law.friction(np.array(shear), *law.theta)
    mu_s, mu_2 = np.linalg.solve(error_model.line(x), mu * np.ones(2)).tolist()
    speed = float(np.sqrt(np.mean(np.hypot(facts.slopes.u, facts.slopes.v) ** 2)))
    misfit = noise * (facts.noise.sigma or 0.0) * math.sqrt(2) / speed
    numbers = inspection.inertia
    vectors = float(numbers.vectors[numbers.flows].sum()) / facts.noise.vectors_per_independent
    known = Known(x, (mu_s, mu_2), misfit=misfit, noise=misfit, vectors=vectors)
    flow, model = inspection.flow, error_model.load()
    known = known._replace(outline=flow.surface is None, real=not flow.of_solver)
    if law.law == mu_of_i.LAW.name:
        found, lost = error_bars.sd_of([known], model), inspection["inertial_number"].lost
        return {n: sd / known.parameters[n] for n, sd in found.items() if n not in lost}
    most = math.sqrt(np.diag(model.method(known) + model.grains(known)).max())
    return {name: most for name in law.friction_law.free if name != law.friction_law.cohesion}


CHECK = Check("precision", Precision, make, seconds=0.3, quick=False)
