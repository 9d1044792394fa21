"""The values of the parameters of a friction law, their errors, and what a flow determines.

Values by name are parameters of a friction law, terms of the loss, or errors in %. Their names come
from tables (`granpinn.physics.laws`, `granpinn.physics.terms`), so that a new law
or a new term needs no change here. `values.mu_s` is `values["mu_s"]`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

from granpinn.physics.terms import NAMES

V = TypeVar("V")

PRESSURES = ("pressure", "pressure_flowing", "pressure_stagnant")
FIELD_ERRORS = ("velocity", *PRESSURES)


class Named(dict[str, V]):
    """Values by name, in order, each an attribute too."""

    def __getattr__(self, name: str) -> V:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"{name} is not one of {', '.join(self)}") from None


class ErrorPercent(Named[float | None]):
    """Relative errors in %, by the parameters of the law and `FIELD_ERRORS`; None: not known.

    The error of a parameter is |value - true| / |true|, of a field eq. (errorL2).
    """

    def __init__(self, *values: Any, **errors: float | None) -> None:
        super().__init__(*values, **errors)
        for name in FIELD_ERRORS:
            self.setdefault(name, None)


class Residuals(Named[float]):
    """Root mean squares of the residuals of a trained network over many points, dimensionless.

    By the terms of the loss (`granpinn.physics.terms`), and "noise". `velocity` is the misfit of
    the fitted data, relative to their root mean square. `noise` is the known measurement noise of
    these data in the same unit, 0 if none is known.

    Raises:
        ValueError: a name is missing or unknown.
    """

    def __init__(self, *values: Any, **residuals: float) -> None:
        super().__init__(*values, **residuals)
        require_names(self, ("noise", *NAMES))


def require_names(
    values: dict[str, Any], needed: tuple[str, ...], allowed: tuple[str, ...] = (), where: str = ""
) -> None:
    """Raise ValueError if a needed name is missing, or if a name is not allowed."""
    for name in values:
        if name not in (*needed, *allowed):
            known = ", ".join((*needed, *allowed))
            raise ValueError(f"{where}{name} is not known; expected {known}")
    for name in needed:
        if name not in values:
            raise ValueError(f"{where}{name} is missing")


NOT_DETERMINED = "not determined"
USELESS = 0.5  # half of a 90 % interval, of the logarithm: beyond, the value is not determined


def half_width(interval: tuple[float, float]) -> float:
    """Half of an interval, of the logarithm."""
    low, high = interval
    return math.log(high / low) / 2 if low > 0 else math.inf


def spans(half: float) -> str:
    """Why a value with an interval of this half width is not determined."""
    return f"its 90 % interval spans a factor of {math.exp(2 * half):.2g}"


@dataclass(frozen=True)
class Determined:
    """What the data determine (uncertainty/determined.py).

    Attributes:
        I_range: of the points that shear, 5th and 95th percentile; None without any.
        lost: names of the parameters that are not determined. Each has `determined` = false and no
            error bars in `parameters`.
        wide: those of `lost` whose 90 % interval is wider than `USELESS`.
        raw_interval_90: of the parameters in `lost` that had one.
        reason: why no friction at any I is determined, in words (estimates/confined.py).
    """

    I_range: tuple[float, float] | None
    lost: tuple[str, ...] = ()
    wide: tuple[str, ...] = ()
    raw_interval_90: dict[str, tuple[float, float]] | None = None
    reason: str | None = None

    def why(self, name: str) -> str:
        """Why a parameter in `lost` is not determined."""
        if self.reason is not None:
            return self.reason
        if name in self.wide and self.raw_interval_90 is not None:
            return spans(half_width(self.raw_interval_90[name]))
        low, high = self.I_range or (0.0, 0.0)
        return f"the grains shear at I = {low:.2g} to {high:.2g} only"

    def __str__(self) -> str:
        """The line for the terminal, where a parameter is not determined."""
        names: dict[str, list[str]] = {}
        for name in self.lost:
            names.setdefault(self.why(name), []).append(name)
        return "; ".join(f"{' and '.join(n)} {NOT_DETERMINED}: {why}" for why, n in names.items())


@dataclass(frozen=True)
class Parameter:
    """One parameter of a friction law, dimensionless.

    `fixed` marks a value that was given, not identified; it then has no uncertainty. A value that
    is not `determined` extrapolates beyond the data: it describes the curve over the I of the data
    together with the other parameters, and nothing by itself.
    """

    value: float
    fixed: bool
    std: float | None = None
    interval_90: tuple[float, float] | None = None
    determined: bool = True

    def __post_init__(self) -> None:
        if self.fixed and (self.std is not None or self.interval_90 is not None):
            raise ValueError(
                "a fixed parameter was not identified: expected std and interval_90 null, "
                f"got std {self.std} and interval_90 {self.interval_90}"
            )
        if not self.determined and (self.fixed or self.std is not None or self.interval_90):
            raise ValueError(
                "a parameter that is not determined has no error bars and was not given: expected "
                f"fixed false, std and interval_90 null, got {self}"
            )
        if self.std is not None and self.std < 0:
            raise ValueError(f"std must not be negative, got {self.std}")
        if self.interval_90 is not None and self.interval_90[0] > self.interval_90[1]:
            raise ValueError(f"interval_90 must be (lower, upper), got {self.interval_90}")

    @property
    def words(self) -> str:
        """The value with its interval, or why it has none."""
        if not self.determined:
            return NOT_DETERMINED
        if self.interval_90 is None:
            return f"{self.value:.4g} ({'fixed' if self.fixed else 'no interval'})"
        return f"{self.value:.4g} ({self.interval_90[0]:.4g} to {self.interval_90[1]:.4g})"


class Parameters(Named[Parameter]):
    """The parameters of a friction law by name, in the order of the law."""


@dataclass(frozen=True)
class Covariance:
    """Covariance matrix of the identified parameters, in the order of `names`."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(self.matrix) != n or any(len(row) != n for row in self.matrix):
            shape = [len(row) for row in self.matrix]
            raise ValueError(f"matrix must be {n} x {n} like names, got rows of length {shape}")
        for i in range(n):
            if self.matrix[i][i] < 0:
                raise ValueError(f"the variance of {self.names[i]} is negative")
            for j in range(i):
                a, b = self.matrix[i][j], self.matrix[j][i]
                if not math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-30):
                    raise ValueError(f"matrix must be symmetric, got {a} and {b}")
