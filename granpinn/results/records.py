"""Records of results.json beside the values: the law, data, training, ensemble and error bars."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata

from granpinn.physics.laws import DEFAULT
from granpinn.results.parameters import NOT_DETERMINED, USELESS, half_width
from granpinn.results.record import Reason

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class DataSummary:
    """The data of the training.

    Attributes:
        noise: the added sd, relative to the maximum speed.
        symmetries: in which directions the flow does not change, in words.
        slips: likely mistakes of unit, sign, size or order in the flow file.
        sampled: which parts of a large flow were used for what; None: all of it for all.
        measured_noise: of the vectors, over their rms velocity; None: they are too few to show it.
        independent: number of independent vectors.
        grain_diameter, density, grain_density: of the material, in the units of the flow file.
        length_unit, density_unit: of these; None: not stated.
    """

    n_points: int
    n_surface: int
    noise: float
    n_frames: int
    symmetries: tuple[str, ...] = ()
    slips: tuple[Reason, ...] = ()
    sampled: str | None = None
    measured_noise: float | None = None
    independent: float | None = None
    grain_diameter: float | None = None
    density: float | None = None
    grain_density: float | None = None
    length_unit: str | None = None
    density_unit: str | None = None


@dataclass(frozen=True)
class Members:
    """The members of an ensemble that ended well, in their order.

    Attributes:
        seed: of each.
        values: of each, by the names of the identified parameters.
        shown: index of the member nearest to the center; the result has the fields of this member.
        diverged: number of members that diverged.
    """

    seed: tuple[int, ...]
    values: dict[str, tuple[float, ...]]
    shown: int = 0
    diverged: int = 0


@dataclass(frozen=True)
class ErrorBars:
    """The parts of the standard deviations of (mu_s, mu_2), and of I0 where it is free; of mu(I).

    Attributes:
        method: sd of the errors in simulated flows (uncertainty/error_model.py).
        freedom: degrees of freedom behind the intervals.
        half_width: of the 90 % intervals, in standard deviations.
        provenance: the trainings behind the error model.
        grains: sd by which real grains depart from mu(I); None: a solver made the data.
        scatter: sd that comes from seeds; None: one member.
        assumptions: sd that comes from uncertain assumptions; None without any.
        outside: in what the run is unlike those trainings, in words.
    """

    method: tuple[float, ...]
    freedom: float
    half_width: float
    provenance: str
    grains: tuple[float, ...] | None = None
    scatter: tuple[float, ...] | None = None
    assumptions: tuple[float, ...] | None = None
    outside: tuple[str, ...] = ()


@dataclass(frozen=True)
class LawPoints:
    """The law of a flow with I0 free, at three inertial numbers (checks/unknown_I0.py).

    Attributes:
        I, log_mu: inertial numbers and log of the friction there [3].
        covariance: of log_mu, as the residuals show it [3, 3].
    """

    I: tuple[float, ...]
    log_mu: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Curve:
    """mu over I, evenly in log I; [n] each.

    Attributes:
        I: inertial numbers.
        mu: friction of the identified law.
        low, high: its pointwise 90 % band; None where it is not determined.
    """

    I: Numbers
    mu: Numbers
    low: Numbers | None = None
    high: Numbers | None = None

    def band(self, k: int) -> str:
        """mu and its band at the point k, in words."""
        if self.low is None or self.high is None:
            return f"{self.mu[k]:.3f}"
        if not self.determines(k):
            return NOT_DETERMINED
        return f"{self.mu[k]:.3f} ({self.low[k]:.3f} to {self.high[k]:.3f})"

    def determines(self, k: int) -> bool:
        """Whether the band at the point k, if there is one, is narrow enough to mean something."""
        if self.low is None or self.high is None:
            return True
        return half_width((self.low[k], self.high[k])) <= USELESS

    def at_ends(self, words: Callable[[int], str]) -> str:
        """`words` of the points at both ends of the range of I."""
        ends = [0, -1] if self.I[-1] > self.I[0] else [0]
        said, places = [words(k) for k in ends], [f"{self.I[k]:.2g}" for k in ends]
        if len({*said}) == 1:
            return f"{said[0]} at I = {' to '.join(places)}"
        return " to ".join(f"{mu} at I = {I}" for mu, I in zip(said, places, strict=True))

    @property
    def half_width(self) -> float | None:
        """Half of the band at its widest place."""
        if self.low is None or self.high is None:
            return None
        return max(high - low for low, high in zip(self.low, self.high, strict=True)) / 2


@dataclass(frozen=True)
class StressPoints:
    """|tau|/p in the fields of the fit over I, where grains shear, in bins of log I; [n] each.

    Attributes:
        I: median of the inertial numbers of a bin.
        mu, low, high: median, 16th and 84th percentile of |tau|/p.
        count: of the points of a bin.
    """

    I: Numbers
    mu: Numbers
    low: Numbers
    high: Numbers
    count: tuple[int, ...]


@dataclass(frozen=True)
class IdentifiedLaw:
    """The identified law over the inertial numbers that the data hold (uncertainty/determined.py).

    Attributes:
        name: of the law (`granpinn.physics.laws.LAWS`).
        I_range: 5th and 95th percentile of I over the points that shear; None without any.
        curve: of the law over `I_range`, and nothing beyond; None where it is not determined.
        points: |tau|/p of the fit.
        reason: why the curve, or its band, is not determined, in words; None if it has both.
    """

    name: str = DEFAULT.name
    I_range: tuple[float, float] | None = None
    curve: Curve | None = None
    points: StressPoints | None = None
    reason: str | None = None

    @property
    def words(self) -> str:
        """The curve at both ends of the range of I, or why it is not known."""
        if self.curve is None:
            return f"{NOT_DETERMINED}: {self.reason}" if self.reason else NOT_DETERMINED
        reason = f"; the error is not known: {self.reason}"
        return self.curve.at_ends(self.curve.band) + (reason if self.curve.low is None else "")


@dataclass(frozen=True)
class Timing:
    wall_s: float
    steps: int


@dataclass(frozen=True)
class Input:
    """The flow file: its name without a folder, and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True)
class Assumed:
    """One assumption of an identification (uncertainty/sensitivity.py).

    Attributes:
        name: of the assumption.
        unit: of its value, "1" without one.
        sd: standard deviation of its value, from the file or by rule.
        example: a change of the assumption in words.
        derivative: of every identified parameter by the value, in 1/unit; None: not known.
        percent: change of every parameter by the example, relative to its value.
        why: the reason for an unknown derivative.
    """

    name: str
    unit: str
    sd: float
    example: str
    derivative: dict[str, float] | None = None
    percent: dict[str, float] | None = None
    why: str | None = None

    def __str__(self) -> str:
        """The line for the terminal."""
        known = f"known to {self.sd:.3g}" + (f" {self.unit}" if self.unit != "1" else "")
        if self.percent is None:
            return f"{self.name} ({known}): its effect is not known: {self.why}"
        changes = ", ".join(f"{name} {value:+.1f} %" for name, value in self.percent.items())
        return f"{self.example}: {changes} ({self.name} {known})"


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    found = {"python": platform.python_version()}
    for name in ("granpinn", "torch", "numpy", "h5py"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found
