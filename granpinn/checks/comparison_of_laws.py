r"""Which friction laws explain the data: a free curve against which all other laws are held.

A free curve and the law with cohesion are trained beside the law of the settings, on the same data.

**Fit.** Each law takes the parameters $\theta$ that are nearest to the free curve $m$ at N
inertial numbers, evenly in log I over the range of the data,

$$ \chi^2 = (\mu(\theta) - m)^T C^{-1} (\mu(\theta) - m) + \text{prior of } I_0, $$

with the covariance C of the curve (uncertainty/curve_error.py). $I_0$ is free here, with a prior of
40 % around its usual value: the range of I of one flow rarely tells it.

**Told apart.** Two laws are told apart where their curves differ by more than 95 % of the errors of
the free curve, and their $\chi^2$ by more than `CLEAR`. Of the laws that are
not told apart from the nearest one, that with the fewest parameters is chosen.

**Cohesion** is no part of a curve mu(I). It comes from its own training, with its error from the
same sums; the law `cohesive` is told from the others where c is significant. Then the free curve,
which has no cohesion, means nothing, and no other law is left.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from granpinn.arrays import Float64
from granpinn.config import Config, ConfigError
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case, fixed_values
from granpinn.fit.context import Context
from granpinn.fit.free_curve import FreeCurve, NoFreeCurveError, quadratic_of
from granpinn.physics.laws import LAWS, FrictionLaw, LawParameter, cohesive, free, mu_of_i
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.record import CARE, Check, Reason, Record, Table
from granpinn.results.result import NORMAL_90
from granpinn.uncertainty.curve_error import CurveBand, basis

COMPANIONS = (free.LAW.name, cohesive.LAW.name)
MOST = 4  # parameters in a line: more are a curve
CHOSEN, ALIKE, EXCLUDED = "chosen", "not told apart", "excluded"  # verdicts
CLEAR = 4.0  # difference of chi^2: two standard deviations
I0_SPREAD = 0.4  # of ln I0
KNOWN = 0.5  # of the spread of its prior: a parameter that the data tell less is not determined
LEAST = 0.02  # of the largest friction: where the search begins at least
REACH = 3.0  # of ln theta, around the start
SINGULAR = 1e-12  # of the largest variance: no direction is known better
RULED_OUT = 3.0  # standard deviations of a cohesion that is not 0


@dataclass(frozen=True)
class ComparedLaw:
    """A law, as near to the free curve as it comes.

    Attributes:
        law: its name.
        verdict: "chosen", "not told apart" from the chosen one, or "excluded".
        parameters: of the law that is nearest to the free curve; not those of the identification.
    """

    law: str
    verdict: str
    parameters: Parameters


@dataclass(frozen=True)
class LawComparison(Record):
    """
    Attributes:
        laws: all of them, the one that the data support first.
    """

    title = "Which law?"
    notes = (
        "The parameters are those of the law that is nearest to the free curve; the values at the "
        "top are from the training with that law. Laws whose curves differ by less than the error "
        "of the free curve are not told apart."
    )

    laws: tuple[ComparedLaw, ...]

    @property
    def words(self) -> str:
        """Which law the data support, which they cannot tell from it, and which they exclude."""
        chosen, law = self.laws[0], LAWS[self.laws[0].law]
        alike, excluded = self._titles(ALIKE), self._titles(EXCLUDED)
        if len(law.names) == 1:  # constant friction
            mu = chosen.parameters[law.names[0]].value
            text = f"a constant friction of {mu:.3g} explains these data"
            if alike:
                text += f" as well as {alike}: how friction rises with I is not known"
        else:
            text = f"{law.title} explains these data"
            text += f"; not told apart: {alike}" if alike else ""
        return text + (f"; excluded: {excluded}" if excluded else "")

    @property
    def table(self) -> Table:
        rows = [(c.law, c.verdict, _values(c.parameters)) for c in self.laws]
        return Table(("law", "verdict", "parameters"), rows)

    def _titles(self, verdict: str) -> str:
        return ", ".join(LAWS[c.law].title for c in self.laws if c.verdict == verdict)

    def reasons(self, result: Result) -> list[Reason]:
        if (result.law.name, EXCLUDED) not in [(c.law, c.verdict) for c in self.laws]:
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
    config = dataclasses.replace(case.config, law=name, free_I0=False)
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
    given, at = {"I0": case.config.I0} | case.config.rheology.fixed, knots(curve.I_range)
    band = curve.band()
    laws = compared(band, (*curve.known.center.tolist(), *curve.ends), curve.covariance(at), given)
    return LawComparison(with_cohesion(laws, _cohesion(context, curve)))


@dataclass(frozen=True)
class Fit:
    """A law near the free curve.

    Attributes:
        theta: all parameters.
        std: standard deviations of ln theta of the free ones, by name; none of a free curve.
        mu: its curve at the I of the band.
        chi2: distance from the free curve.
    """

    law: FrictionLaw
    theta: tuple[float, ...]
    std: dict[str, float]
    mu: Float64
    chi2: float


def knots(I_range: tuple[float, float]) -> Float64:
    """The N inertial numbers at which fits are made."""
    return np.geomspace(*I_range, free.COEFFICIENTS)


def compared(
    band: CurveBand, theta: Sequence[float], covariance: Float64, given: Mapping[str, float]
) -> tuple[ComparedLaw, ...]:
    """The free curve and every law without cohesion, the chosen one first.

    Args:
        theta: parameters of the free curve.
        covariance: C of the free curve at `knots` [N, N].
        given: values of fixed parameters, by name.
    """
    I = knots((float(band.I[0]), float(band.I[-1])))
    m = basis(I, *theta[free.COEFFICIENTS :]) @ np.array(theta[: free.COEFFICIENTS])
    variances, directions = np.linalg.eigh(covariance)
    root = (directions / np.sqrt(np.maximum(variances, SINGULAR * variances[-1]))).T
    curve = Fit(free.LAW, tuple(theta), {}, band.mu, 0.0)
    named = [
        fit_to_curve(law, given, band.I, I, m, root)
        for law in LAWS.values()
        if law.compiled and not (law.curve or law.cohesion)
    ]
    found = [curve, *named]
    best = min(named, key=lambda fit: fit.chi2)
    if _differ(best, curve, band):
        best = curve  # no named law is near the free curve
    near = [fit for fit in found if fit is best or not apart(fit, best, band)]
    chosen = min(near, key=lambda fit: len(fit.law.free))
    others = [fit for fit in found if fit is not chosen]
    return (
        ComparedLaw(chosen.law.name, CHOSEN, parameters(chosen)),
        *(
            ComparedLaw(o.law.name, EXCLUDED if apart(o, chosen, band) else ALIKE, parameters(o))
            for o in others
        ),
    )


def fit_to_curve(
    law: FrictionLaw,
    given: Mapping[str, float],
    at: Float64,
    I: Float64,
    m: Float64,
    root: Float64,
) -> Fit:
    """The fit of a law to a free curve m at I [N], with its curve at other inertial numbers.

    Args:
        given: values of fixed parameters, by name.
        root: R of C^-1 = R^T R [N, N].
    """
    scale = law.inertial_scale
    unknown = [p for p in law.parameters if not p.fixed or p.name == scale]
    least = LEAST * np.abs(m).max()  # a curve of few data may fall below 0

    def usual_of(p: LawParameter) -> float:
        """The start of a parameter: of a coefficient of friction, from the free curve."""
        if p.name == law.names[0]:
            return float(max(m.min(), least))
        if p.variable == "log_above":
            return float(max(np.ptp(m), least))
        return given.get(p.name, p.start)

    def theta_at(z: Float64) -> list[float]:
        """All parameters at logarithms z of the unknown ones."""
        values = dict(zip((p.name for p in unknown), np.exp(z).tolist(), strict=True))
        theta: list[float] = []
        for p in law.parameters:
            value = values.get(p.name, given.get(p.name, p.start))
            theta.append(theta[-1] + value if p.variable == "log_above" else value)
        return theta

    def curve(z: Float64, I: Float64) -> Float64:
        return np.broadcast_to(law.friction(I, *theta_at(z)), I.shape)

    usual = np.log([usual_of(p) for p in unknown])
    has_prior = np.array([p.name == scale for p in unknown])

    def residuals(z: Float64) -> Float64:
        return np.append(root @ (curve(z, I) - m), ((z - usual) / I0_SPREAD)[has_prior])

    own = np.log([p.bounds for p in unknown])
    bounds = np.minimum(usual - REACH, own[:, 0]), np.maximum(usual + REACH, own[:, 1])
    found = scipy.optimize.least_squares(residuals, np.clip(usual, *bounds), bounds=bounds)
    normal = found.jac.T @ found.jac
    # a direction that no data determine is as uncertain as the reach of the search
    covariance = np.linalg.inv(normal + REACH**-2 * np.eye(len(normal)))
    std = dict(zip((p.name for p in unknown), np.sqrt(np.diag(covariance)).tolist(), strict=True))
    return Fit(law, tuple(theta_at(found.x)), std, curve(found.x, at), 2 * float(found.cost))


def apart(a: Fit, b: Fit, band: CurveBand) -> bool:
    """Whether two laws are told apart."""
    return _differ(a, b, band) and abs(a.chi2 - b.chi2) > CLEAR


def _differ(a: Fit, b: Fit, band: CurveBand) -> bool:
    return bool((np.abs(a.mu - b.mu) > band.farthest).any())


def parameters(fit: Fit) -> Parameters:
    """The values of a fit with their errors."""
    return Parameters(
        (p.name, _parameter(p, value, fit.std.get(p.name), fit))
        for p, value in zip(fit.law.parameters, fit.theta, strict=True)
    )


def _parameter(p: LawParameter, value: float, std: float | None, fit: Fit) -> Parameter:
    if std is None:
        return Parameter(value, fixed=p.fixed)
    spread = I0_SPREAD if p.name == fit.law.inertial_scale else REACH
    if std > KNOWN * spread:
        return Parameter(value, fixed=False, undetermined="the free curve does not tell it")
    if p.variable == "log_above":  # the unknown is the distance from the parameter before it
        std *= 1 - fit.theta[fit.law.names.index(p.name) - 1] / value
    ends = value * math.exp(-NORMAL_90 * std), value * math.exp(NORMAL_90 * std)
    return Parameter(value, fixed=False, std=value * std, interval_90=ends)


def _cohesion(context: Context, curve: FreeCurve) -> ComparedLaw:
    """The law of the training with cohesion."""
    case, run, law = context.case, context.run, cohesive.LAW
    place = context.of_laws[law.name]
    known = quadratic_of(run, place, len(law.free))
    if known is None:
        raise NoFreeCurveError("the training with cohesion did not end with its last layer")
    theta = run.trainer.solution(place)[1].tolist()
    k, unit = law.free.index("c"), case.scales.pressure
    c = float(known.center[k])
    without, part = (curve.scale * e for e in (curve.model.cohesion, curve.model.cohesion_part))
    least = math.hypot(math.sqrt(known.covariance[k, k]), without)
    std = math.hypot(least, part * c)
    return cohesive_law(law.to_physical(theta, unit), c * unit, least * unit, std * unit)


def cohesive_law(theta: Sequence[float], c: float, least: float, std: float) -> ComparedLaw:
    """The law with cohesion: chosen if there is one, else with a c that is not determined.

    Args:
        theta: all parameters, in the unit of the pressure of the file.
        c: the cohesion.
        least: its standard deviation if there is none.
        std: its standard deviation.
    """
    law, sure, reach = cohesive.LAW, c > RULED_OUT * least, NORMAL_90 * std
    own = Parameter(c, False, undetermined="it cannot be told from 0")
    if sure:
        own = Parameter(c, False, std, (max(0.0, c - reach), c + reach))
    values = {
        p.name: own if p.name == law.cohesion else Parameter(value, fixed=p.fixed)
        for p, value in zip(law.parameters, theta, strict=True)
    }
    return ComparedLaw(law.name, CHOSEN if sure else ALIKE, Parameters(values))


def with_cohesion(laws: Sequence[ComparedLaw], found: ComparedLaw) -> tuple[ComparedLaw, ...]:
    """The laws with that with cohesion: alone, or at the end with the verdict of mu(I)."""
    if found.verdict == CHOSEN:
        return (found, *(dataclasses.replace(law, verdict=EXCLUDED) for law in laws))
    base = next(law for law in laws if law.law == mu_of_i.LAW.name)
    verdict = EXCLUDED if base.verdict == EXCLUDED else ALIKE
    return (*laws, dataclasses.replace(found, verdict=verdict))


CHECK = Check(
    "comparison_of_laws", LawComparison, make, seconds=2.0, flag="compare_laws", quick=False
)
