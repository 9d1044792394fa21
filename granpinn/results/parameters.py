"""The values of the parameters of a friction law, and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granpinn.results.determined import NOT_DETERMINED
from granpinn.results.named import Named


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
