"""Which friction laws explain the data: a free curve against which all other laws are held.

A free curve and the law with cohesion are trained beside the law of the settings, on the same data.
All other laws are held against the free curve (uncertainty/law_choice.py).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from granpinn.config import Config, ConfigError
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case, fixed_values
from granpinn.fit.context import Context
from granpinn.fit.free_curve import FreeCurve, NoFreeCurveError, quadratic_of
from granpinn.physics.laws import LAWS, cohesive, free
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.record import CARE, Check, Reason, Record, Table
from granpinn.results.records import ComparedLaw
from granpinn.uncertainty import law_choice
from granpinn.uncertainty.law_choice import Cohesion

COMPANIONS = (free.LAW.name, cohesive.LAW.name)
MOST = 4  # parameters in a line: more are a curve


@dataclass(frozen=True)
class LawComparison(Record):
    """
    Attributes:
        laws: all of them.
        chosen: name of the law that the data support.
    """

    title = "Which law?"
    notes = (
        "The parameters are those of the law that is nearest to the free curve; the values at the "
        "top are from the training with that law. Laws whose curves differ by less than the error "
        "of the free curve are not told apart."
    )

    laws: tuple[ComparedLaw, ...]
    chosen: str

    def __post_init__(self) -> None:
        if self.chosen not in (found := [c.law for c in self.laws]):
            raise ValueError(f"chosen must be one of {', '.join(found)}, got {self.chosen}")

    @property
    def words(self) -> str:
        """Which law the data support, which they cannot tell from it, and which they exclude."""
        chosen = next(c for c in self.laws if c.law == self.chosen)
        alike = chosen.not_told_apart_from
        if len(LAWS[chosen.law].names) == 1:  # constant friction
            mu = chosen.parameters[LAWS[chosen.law].names[0]].value
            text = f"a constant friction of {mu:.3g} explains these data"
            if alike:
                text += f" as well as {_titles(alike)}: how friction rises with I is not known"
        else:
            text = f"{LAWS[chosen.law].title} explains these data"
            text += f"; not told apart: {_titles(alike)}" if alike else ""
        return text + (f"; excluded: {_titles(self.excluded)}" if self.excluded else "")

    @property
    def table(self) -> Table:
        verdicts = dict.fromkeys(self.excluded, "excluded") | {self.chosen: "chosen"}
        rows = [
            (c.law, verdicts.get(c.law, "not told apart"), _values(c.parameters)) for c in self.laws
        ]
        return Table(("law", "verdict", "parameters"), rows)

    @property
    def excluded(self) -> list[str]:
        """Names of the laws that the data tell from the chosen one."""
        alike = next(c.not_told_apart_from for c in self.laws if c.law == self.chosen)
        return [c.law for c in self.laws if c.law != self.chosen and c.law not in alike]

    def reasons(self, result: Result) -> list[Reason]:
        if result.law.name not in self.excluded:
            return []
        return [Reason(CARE, f"The data support another law: {self.words}.")]


def _values(parameters: Parameters) -> str:
    """The identified values in a line."""
    if sum(not p.fixed for p in parameters.values()) > MOST:
        return "a curve"
    texts = []
    for name, p in parameters.items():
        if p.fixed:
            continue
        if not p.determined:
            texts.append(f"{name} not determined")
        elif p.std is None:
            texts.append(f"{name} {p.value:.3g}")
        else:
            texts.append(f"{name} {p.value:.3f} ± {p.std:.3f}")
    return ", ".join(texts)


def _titles(names: Sequence[str]) -> str:
    return ", ".join(LAWS[name].title for name in names)


def companions(case: Case) -> list[Case]:
    """Members with the data of a case and the other laws that a comparison needs, if it is asked
    for.

    Raises:
        ConfigError: the settings hold for one law alone.
    """
    config = case.config
    if not CHECK.wanted(config):
        return []
    if not LAWS[config.law].compiled:
        raise ConfigError(
            f"--compare-laws compares the laws of granpinn, got your own law {config.law}: leave "
            "--compare-laws out"
        )
    return [_with_law(case, name) for name in _others(config)]


def _others(config: Config) -> list[str]:
    return [name for name in COMPANIONS if name != config.law] if CHECK.wanted(config) else []


def _with_law(case: Case, name: str) -> Case:
    config = dataclasses.replace(case.config, law=name)
    fixed = fixed_values(config, case.facts)
    member = dataclasses.replace(case.member, law=LAWS[name], fixed=fixed)
    return dataclasses.replace(case, config=config, member=member)


def places(case: Case, own: int, first: int) -> dict[str, int]:
    """The place in the run of every law of a comparison.

    Args:
        own: place of the member with the law of the settings.
        first: of the first companion.
    """
    return {case.config.law: own} | {n: first + k for k, n in enumerate(_others(case.config))}


def make(context: Context) -> LawComparison:
    case, run, result = context.case, context.run, context.result
    if (reason := undetermined(case.seen, case.config.level)) is not None:
        raise NoFreeCurveError(reason)
    curve = FreeCurve(result, case, run, context.of_laws[free.LAW.name])
    fixed = {name: {"I0": case.config.I0} | case.config.rheology.fixed for name in LAWS}
    band, at_knots = curve.band(), curve.covariance(law_choice.knots(curve.I_range))
    found = law_choice.fits(curve.known, curve.ends, band, at_knots, fixed)
    records, chosen = law_choice.choice(found, band)
    cohesion = _cohesion(context, curve)
    return LawComparison(*law_choice.with_cohesion(records, chosen, cohesion))


def _cohesion(context: Context, curve: FreeCurve) -> Cohesion:
    """What the training with cohesion found."""
    case, run, law = context.case, context.run, cohesive.LAW
    place = context.of_laws[law.name]
    known = quadratic_of(run, place, len(law.free))
    if known is None:
        raise NoFreeCurveError("the training with cohesion did not end with its last layer")
    theta = run.trainer.solution(place)[1].tolist()
    k = law.free.index("c")
    c = float(known.center[k])
    without, part = (curve.scale * e for e in (curve.model.cohesion, curve.model.cohesion_part))
    least = math.hypot(math.sqrt(known.covariance[k, k]), without)
    std = math.hypot(least, part * c)
    unit = case.scales.pressure
    values = Parameters(
        (p.name, Parameter(value, fixed=p.fixed))
        for p, value in zip(law.parameters, law.to_physical(theta, unit), strict=True)
    )
    return Cohesion(values, c * unit, least * unit, std * unit)


CHECK = Check(
    "comparison_of_laws", LawComparison, make, seconds=2.0, flag="compare_laws", quick=False
)
