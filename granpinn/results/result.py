"""The result of an identification, and its file results.json.

A number without a meaning is None here and null in the file, never 0: an error without a reference.
The file is strict JSON (no NaN, no Infinity), written atomically, and validated when it is read.

Format version 2.  A field may be added with a default; any other change needs a new version.
Version 2 adds the friction law (mu(I) if a file names none) and `members.diverged`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from granpinn.config import LEVELS
from granpinn.data import Truth
from granpinn.errors import BadInput
from granpinn.output import write_text
from granpinn.physics.laws import LAWS, Law
from granpinn.physics.terms import FORMS
from granpinn.results.assumed import Assumed
from granpinn.results.baseline import Baseline
from granpinn.results.comparison import ComparedLaw, table
from granpinn.results.decoding import decode, encode
from granpinn.results.determined import NOT_DETERMINED, Determined
from granpinn.results.findings import Loss, Profile, Resimulation, SimulatedPressure
from granpinn.results.identified_law import IdentifiedLaw
from granpinn.results.json_values import plain
from granpinn.results.named import FIELD_ERRORS, ErrorPercent, Residuals, require_names
from granpinn.results.parameters import Covariance, Parameters
from granpinn.results.parts import Parts
from granpinn.results.records import DataSummary, ErrorBars, Members, NotDone, Verdict, Zones

FORMAT_NAME = "granpinn-results"
FORMAT_VERSION = 2


class ResultsFileError(BadInput):
    """results.json is missing, is not JSON, or breaks a rule of the format."""


@dataclass(frozen=True)
class InertialNumber:
    """Quantiles of I over the grains: the data determine the friction law over this band only."""

    q05: float
    median: float
    q95: float


@dataclass(frozen=True)
class Timing:
    wall_s: float
    steps: int
    steps_per_s: float | None = None


@dataclass(frozen=True)
class Input:
    """The flow file: its name without a folder, and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True)
class Result:
    """All records of one identification.

    Attributes:
        law: the friction law and its curve over the I of the data.
        failure: why the training of a member of a batch ended before the others; the numbers then
            belong to its last good state, and `stopped` is "diverged".
        not_done: parts after the identification that the run lacks, with the reasons.
        parts: the law on parts of the data.
        assumptions: what the data do not contain, and its effect on the law.
    """

    parameters: Parameters
    level: str
    form: str
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
    zones: Zones | None = None
    inertial_number: InertialNumber | None = None
    covariance: Covariance | None = None
    loss: Loss | None = None
    simulated_pressure: SimulatedPressure | None = None
    profile: Profile | None = None
    resimulation: Resimulation | None = None
    members: Members | None = None
    residuals: Residuals | None = None
    error_bars: ErrorBars | None = None
    verdict: Verdict | None = None
    baseline: Baseline | None = None
    determined: Determined | None = None
    not_done: tuple[NotDone, ...] = ()
    parts: Parts | None = None
    assumptions: tuple[Assumed, ...] = ()
    comparison: tuple[ComparedLaw, ...] = ()
    chosen: str | None = None

    def __post_init__(self) -> None:
        given = {"level": self.level, "form": self.form, "law": self.law.name}
        for name, allowed in (("level", LEVELS), ("form", FORMS), ("law", tuple(LAWS))):
            if given[name] not in allowed:
                expected = ", ".join(allowed)
                own = ", or a law that granpinn.laws.register was given" if name == "law" else ""
                raise ValueError(f"{name} must be one of {expected}{own}, got {given[name]!r}")
        law = self.friction_law
        require_names(self.parameters, law.names, where="parameters.")
        require_names(self.error_percent, FIELD_ERRORS, law.names, "error_percent.")
        for p in law.parameters:
            if p.fixed and self.parameters[p.name].value <= 0:
                value = self.parameters[p.name].value
                raise ValueError(f"parameters: {p.name} must be positive, got {value}")
        if self.members is not None:
            require_names(self.members.values, law.free, where="members.")
        for assumed in self.assumptions:
            for name in ("derivative", "percent"):
                if (values := getattr(assumed, name)) is not None:
                    require_names(values, law.free, where=f"assumptions.{name}.")
        for name in self.covariance.names if self.covariance else ():
            if name not in law.names:
                known = ", ".join(law.names)
                raise ValueError(f"covariance.names must be among {known}, got {name}")

    @property
    def friction_law(self) -> Law:
        """The law itself: its parameters and its curve."""
        return LAWS[self.law.name]

    @property
    def theta(self) -> tuple[float, ...]:
        """The values of the parameters, in the order of the law."""
        return tuple(self.parameters[name].value for name in self.friction_law.names)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; non-finite numbers in it are None."""
        content = {"format_name": FORMAT_NAME, "format_version": FORMAT_VERSION, "law": None}
        values: dict[str, Any] = plain(content | encode(self))
        return values

    def __str__(self) -> str:
        """The lines that a terminal shows at the end of a run."""
        lines = [
            f"{'':6s}{'value':>9s}{'std':>10s}{'90 % interval':>19s}{'true':>9s}{'error %':>10s}"
        ]
        for name, p in self.parameters.items():
            std = "fixed" if p.fixed else number(p.std, ".4f")
            interval = " to ".join(f"{end:.4f}" for end in p.interval_90 or ()) or "-"
            true = number(getattr(self.truth, name, None), ".4f")
            error = number(self.error_percent.get(name), ".2f")
            head = f"{p.value:9.4f}{std:>10s}" if p.determined else f"{NOT_DETERMINED:>19s}"
            lines.append(f"{name:6s}{head}{interval:>19s}{true:>9s}{error:>10s}")
        for name in FIELD_ERRORS:
            error = number(self.error_percent[name], ".2f")
            if error != "-" or "simulated" not in name:
                lines.append(f"{name.replace('_', ', '):53s}{error:>10s}")
        if self.determined is not None and self.determined.lost:
            lines.append(str(self.determined))
        if self.law.I_range is not None:
            lines.append(str(self.law))
        if self.verdict is not None:
            lines.append(self.verdict.words)
        lines += table(self.comparison, self.chosen)
        lines += [str(assumed) for assumed in self.assumptions]
        parts = (self.baseline, self.simulated_pressure, self.profile, self.resimulation)
        lines += [str(part) for part in (*parts, *self.not_done) if part is not None]
        return "\n".join(lines)


def number(value: float | None, spec: str) -> str:
    """`value` formatted, a dash where there is none."""
    return "-" if value is None else format(value, spec)


def write_results(result: Result, path: str | Path) -> None:
    """Write results.json.  The result is decoded first, so that the file can be read back."""
    content = result.to_dict()
    from_dict(content)
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


def read_results(path: str | Path) -> Result:
    """Read and validate results.json; the message of ResultsFileError is one sentence."""
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    except FileNotFoundError:
        raise ResultsFileError(
            f"{path} does not exist: give the folder of a finished run of granpinn.train"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ResultsFileError(f"{path} could not be read as strict JSON: {error}") from None
    return from_dict(content, path.name)


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number, expected null")


def from_dict(content: Any, where: str = "the result") -> Result:
    """The inverse of `Result.to_dict`; the message of ResultsFileError is one sentence."""
    if not isinstance(content, dict):
        raise ResultsFileError(f"{where} must hold an object, got {type(content).__name__}")
    content = dict(content)
    found = (content.pop("format_name", None), content.pop("format_version", None))
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ResultsFileError(
            f"{where} must have format_name {FORMAT_NAME!r} and format_version {FORMAT_VERSION}, "
            f"got {found[0]!r} and {found[1]!r}: read it with the granpinn that wrote it"
        )
    try:
        return decode(Result, content)
    except ValueError as error:
        raise ResultsFileError(f"{where}: {error}") from None
