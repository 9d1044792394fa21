"""Values by name: parameters of a friction law, terms of the loss, errors in %.

Their names come from tables (`granpinn.physics.laws`, `granpinn.physics.terms`), so that a new law
or a new term needs no change here. `values.mu_s` is `values["mu_s"]`.
"""

from __future__ import annotations

from typing import Any, TypeVar

from granpinn.physics.terms import NAMES

V = TypeVar("V")

PRESSURES = ("pressure", "pressure_flowing", "pressure_stagnant")
SIMULATED = ("pressure_simulated", "pressure_simulated_flowing", "pressure_simulated_stagnant")
FIELD_ERRORS = ("velocity", *PRESSURES, *SIMULATED)


class Named(dict[str, V]):
    """Values by name, in order, each an attribute too."""

    def __getattr__(self, name: str) -> V:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"{name} is not one of {', '.join(self)}") from None


class ErrorPercent(Named[float | None]):
    """Relative errors in %, by the parameters of the law and `FIELD_ERRORS`; None: not known.

    The error of a parameter is |value - true| / |true|, of a field eq. (errorL2). Errors of the
    simulated pressure are over the frames that have one.
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
