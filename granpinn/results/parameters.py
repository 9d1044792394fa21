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


def require_names(values: dict[str, Any], needed: tuple[str, ...], where: str = "") -> None:
    """Raise ValueError if a needed name is missing, or if there is another one."""
    for name in values:
        if name not in needed:
            raise ValueError(f"{where}{name} is not known; expected {', '.join(needed)}")
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
class Parameter:
    """One parameter of a friction law, dimensionless.

    Attributes:
        fixed: whether the value was given, not identified; it then has no uncertainty.
        undetermined: why the value means nothing by itself, in words; None: it is determined. It
            extrapolates beyond the data: with the other parameters it describes the curve over the
            I of the data.
    """

    value: float
    fixed: bool
    std: float | None = None
    interval_90: tuple[float, float] | None = None
    undetermined: str | None = None

    @property
    def determined(self) -> bool:
        return self.undetermined is None

    @property
    def words(self) -> str:
        """The value with its interval, or that it has none."""
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
        sides = [len(self.matrix), *map(len, self.matrix)]
        if set(sides) != {len(self.names)}:
            raise ValueError(f"matrix must have {len(self.names)} rows and columns, got {sides}")
