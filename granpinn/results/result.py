"""The result of an identification, which results.json holds (results_file.py).

A number without a meaning is None here and null in the file, never 0: an error without a reference.
The file is strict JSON (no NaN, no Infinity), written atomically, and validated when it is read.

Format version 6.  A field may be added with a default; any other change needs a new version.

The answer in a few lines, for the terminal: values, the law, the grade and its reason.

mu_s   0.398  (0.395 to 0.402)   true 0.400   90 % intervals
mu_2   0.659  (0.623 to 0.697)   true 0.640   extrapolated: the flow reaches 0.33 I0
I0     0.300                     true 0.300   given
mu(I)  0.402 +- 0.004 at I = 0.0048 to 0.465 +- 0.008 at I = 0.1
GOOD   the equations hold; ...
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.config import Level
from granpinn.data import Truth
from granpinn.output import write_text
from granpinn.output.table import Table, paragraph
from granpinn.physics.laws import LAWS, FrictionLaw
from granpinn.physics.terms import Form
from granpinn.results import export
from granpinn.results.assessment import Assessment, assess, evidence, reach_of
from granpinn.results.decoding import plain
from granpinn.results.parameters import (
    FIELD_ERRORS,
    NOT_DETERMINED,
    Covariance,
    ErrorPercent,
    Parameter,
    Parameters,
    Residuals,
    require_names,
)
from granpinn.results.record import Record
from granpinn.results.records import (
    Assumed,
    DataSummary,
    ErrorBars,
    IdentifiedLaw,
    Input,
    Members,
    Timing,
)


@dataclass(frozen=True)
class FlowOfLaw:
    """
    Attributes:
        I_range: 5th and 95th percentile of I over its points that shear; None without any.
        assessment: of the fit of this flow.
    """

    input: Input
    data: DataSummary
    I_range: tuple[float, float] | None
    assessment: Assessment

    def __str__(self) -> str:
        """The line for the terminal."""
        return f"{self.input.name}: {self.shear}, {self.assessment.headline}"

    @property
    def shear(self) -> str:
        """Its range of I in words."""
        if self.I_range is None:
            return "no grains shear"
        low, high = self.I_range
        return f"I = {low:.2g} to {high:.2g}"


FORMAT_NAME = "granpinn-results"
FORMAT_VERSION = 6


@dataclass(frozen=True)
class Result:
    """All records of one identification.

    Attributes:
        law: the friction law and its curve over the I of the data.
        failure: why the training of a member of a batch ended before the others; the numbers then
            belong to its last good state, and `stopped` is "diverged".
        no_law: why the flow determines no friction coefficient (estimates/confined.py), in words;
            None: it may.
        flows: of several flows that have one law, each with its own facts; (): one flow.
        assumptions: what the data do not contain, and its effect on the law.
        checks: the records of the checks that were made, by the names of the checks.
        not_done: why parts after the identification are missing, by their names.
    """

    parameters: Parameters
    level: Level
    form: Form
    recipe: str
    seed: int
    data: DataSummary
    timing: Timing
    device: str
    versions: dict[str, str]
    input: Input
    law: IdentifiedLaw = field(default_factory=IdentifiedLaw)
    settings: dict[str, Any] = field(default_factory=dict)
    stopped: str = "steps"
    failure: str | None = None
    truth: Truth | None = None
    error_percent: ErrorPercent = field(default_factory=ErrorPercent)
    covariance: Covariance | None = None
    members: Members | None = None
    residuals: Residuals | None = None
    error_bars: ErrorBars | None = None
    no_law: str | None = None
    flows: tuple[FlowOfLaw, ...] = ()
    assumptions: tuple[Assumed, ...] = ()
    checks: dict[str, Any] = field(default_factory=dict)
    not_done: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.law.name not in LAWS:
            raise ValueError(
                f"law must be one of {', '.join(LAWS)}, or a law that granpinn.laws.register was "
                f"given, got {self.law.name!r}"
            )
        require_names(self.parameters, self.friction_law.names, where="parameters.")

    def with_record(self, part: str, record: Record | None) -> Self:
        """The result with what a check found, or with a part that leaves no record."""
        checks = self.checks if record is None else self.checks | {part: record}
        not_done = {name: why for name, why in self.not_done.items() if name != part}
        return dataclasses.replace(self, checks=checks, not_done=not_done)

    def without(self, part: str, why: str) -> Self:
        """The result that lacks a part, for a reason."""
        return dataclasses.replace(self, not_done=self.not_done | {part: why})

    @property
    def friction_law(self) -> FrictionLaw:
        """The law itself: its parameters and its curve."""
        law = LAWS[self.law.name]
        given = {name for name, p in self.parameters.items() if p.fixed}
        held = (p for p in law.parameters if p.fixed)
        return law.with_free({p.name: p.start for p in held if p.name not in given})

    @property
    def assessment(self) -> Assessment:
        """May these numbers be used? A function of the other records."""
        return assess(self)

    @property
    def theta(self) -> tuple[float, ...]:
        """The values of the parameters, in the order of the law."""
        return tuple(self.parameters[name].value for name in self.friction_law.names)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; non-finite numbers in it are None."""
        content: dict[str, Any] = {"format_name": FORMAT_NAME, "format_version": FORMAT_VERSION}
        content |= {"assessment": plain(self.assessment), "law": None}
        return {**content, **plain(self)}

    def __repr__(self) -> str:
        """One line: the input, the level and the parameters."""
        found = ", ".join(f"{name} = {p.words}" for name, p in self.parameters.items())
        return f"{type(self).__name__}({self.input.name}, level {self.level}: {found})"

    def __str__(self) -> str:
        """The answer in a few lines, as a terminal shows it at the end of a run."""
        return "\n".join([*brief(self), *self._missing()])

    def export(self, to: str, path: str | os.PathLike[str] | None = None) -> str:
        """The law as the text of an input file of another program (export.py).

        Args:
            to: "openfoam", "basilisk", "chrono", or "json".
            path: file to write; None: none is written.

        Raises:
            BadInput: the program cannot take this law, or a number is not determined.
            OutputError: the file cannot be written.
        """
        text = export.text_of(self, to)
        if path is not None:
            write_text(path, text)
        return text

    def summary(self) -> str:
        """All that is known as text: tables, every check, and the assessment at the end."""
        lines = [
            line
            for part in self._parts()
            for line in (part.lines() if isinstance(part, Table) else [part])
        ]
        return "\n".join([*lines, f"assessment: {self.assessment}"])

    def _repr_html_(self) -> str:
        """The same for notebooks, with the assessment first."""
        parts = [
            part.html() if isinstance(part, Table) else paragraph(part) for part in self._parts()
        ]
        return "\n".join([paragraph(str(self.assessment)), *parts])

    def _parts(self) -> list[str | Table]:
        checks = [part for c in self.checks.values() for part in (c.words, c.table) if part]
        return [self.table, *self._facts(), *checks, *self._missing()]

    @property
    def table(self) -> Table:
        """Every parameter, and the error of every field."""
        rows = []
        for name, p in self.parameters.items():
            std = "given" if p.fixed else number(p.std, ".4f")
            ends = p.interval_90 if p.determined and p.interval_90 else ()
            interval = " to ".join(f"{end:.4f}" for end in ends) or "-"
            true = number(getattr(self.truth, name, None), ".4f")
            value, std = (f"{p.value:.4f}", std) if p.determined else (NOT_DETERMINED, "")
            rows.append((name, value, std, interval, true, percent(self.error_percent.get(name))))
        for name in FIELD_ERRORS:
            error = percent(self.error_percent[name])
            rows.append((name.replace("_", ", "), "", "", "", "", error))
        return Table(("", "value", "std", "90 % interval", "true", "error %"), rows)

    def _facts(self) -> list[str]:
        """What is known of the law beside its numbers."""
        lost: dict[str, list[str]] = {}
        for name, p in self.parameters.items():
            if p.undetermined is not None:
                lost.setdefault(p.undetermined, []).append(name)
        parts: list[object] = [
            f"{' and '.join(names)} {NOT_DETERMINED}: {why}" for why, names in lost.items()
        ]
        parts += [] if self.law.I_range is None else [f"mu(I) = {self.law.words}"]
        return list(map(str, [*parts, *self.flows, *self.assumptions]))

    def _missing(self) -> list[str]:
        return [f"no {in_words(name)}: {why}" for name, why in self.not_done.items()]


def in_words(name: str) -> str:
    """A name of a check or of another part in words."""
    return name.replace("_", " ")


def number(value: float | None, spec: str) -> str:
    """`value` formatted, a dash where there is none."""
    return "-" if value is None else format(value, spec)


def percent(value: float | None) -> str:
    """An error in %: two decimals, or two digits of a small one; a dash where there is none."""
    return number(value, ".2g" if value is not None and value < 0.1 else ".2f")


NORMAL_90 = 1.645  # half-width of the central 90 % of a normal distribution, in sd


def true_friction(result: Result, I: Floats) -> Float64 | None:
    """mu of the law that made the data, at I [n]; None if one of its parameters is unknown.

    A parameter with an unknown true value that was given in the identification counts as true.
    """
    truth = result.truth
    if truth is None:
        return None
    law, theta = truth.friction_law, []
    for name, true in zip(law.names, truth.theta, strict=True):
        given = result.parameters.get(name) if law.name == result.law.name else None
        if true is None and (given is None or not given.fixed):
            return None
        theta.append(float(true if true is not None or given is None else given.value))
    return np.asarray(law.friction(np.asarray(I, np.float64), *theta), np.float64)


def friction_sd(I: Floats, result: Result, covariance: Covariance) -> Floats:
    r"""Standard deviation of the law [n] from the covariance C of its parameters, to first order:

    $$ \sigma_\mu^2 = J\,C\,J^T, \quad J = \partial \mu / \partial \theta. $$
    """
    law = result.friction_law
    rows = law.by_parameters(np.asarray(I, np.float64), result.theta)
    J = rows[:, [law.names.index(name) for name in covariance.names]]
    variance = np.einsum("ni,ij,nj->n", J, np.array(covariance.matrix), J)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def brief(result: Result) -> list[str]:
    """The lines for a terminal."""
    rows = [_row(result, name, p) for name, p in result.parameters.items()]
    seen = next((row for row in rows if row[1].endswith(")")), None)
    if seen is not None:
        seen[3] = "; ".join(["90 % intervals", *filter(None, [seen[3]])])
    wide = [max(len(row[k]) for row in rows) for k in range(4)]
    made = [
        "   ".join(cell.ljust(w) for cell, w in zip(row, wide, strict=True) if w).rstrip()
        for row in rows
    ]
    made.append(f"mu(I)   {_curve(result.law)}")
    made += [f"flow    {flow}" for flow in result.flows]
    made.append(f"{result.assessment.grade.upper():4s}    {evidence(result)}")
    return made


def _row(result: Result, name: str, p: Parameter) -> list[str]:
    """Name, value with interval, true value, and a note."""
    value = _short(p.value) if p.determined else NOT_DETERMINED
    if p.determined and p.interval_90 is not None:
        value += f"  ({_short(p.interval_90[0])} to {_short(p.interval_90[1])})"
    true = getattr(result.truth, name, None)
    reach = reach_of(result) if name == "mu_2" else None
    notes = ["given"] if p.fixed else []
    notes += [] if p.undetermined is None else [p.undetermined]
    notes += [] if reach is None else [f"extrapolated: the flow reaches {reach:.2g} I0"]
    return [f"{name:5s}", value, "" if true is None else f"true {_short(true)}", "".join(notes)]


def _curve(law: IdentifiedLaw) -> str:
    """mu at both ends of the I of the data, with half of the 90 % interval."""
    curve = law.curve
    if curve is None or curve.low is None or curve.high is None:
        return law.words
    half = [(high - low) / 2 for low, high in zip(curve.low, curve.high, strict=True)]

    def words(k: int) -> str:
        known = f"{_short(curve.mu[k])} +- {_short(half[k])}"
        return known if curve.determines(k) else NOT_DETERMINED

    return curve.at_ends(words)


def _short(value: float) -> str:
    """Three decimals; two digits of a small number, three of a large one."""
    return f"{value:.3f}" if 0.001 <= abs(value) < 100 or value == 0 else f"{value:.3g}"
