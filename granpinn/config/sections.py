"""The groups of settings.

Quantities are dimensionless (length H0, velocity sqrt(g H0), ...; granpinn/physics/scales.py)
unless the help of a field says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, make_dataclass
from typing import Any, Literal

from granpinn.config.fields import TINY, ConfigError, setting
from granpinn.physics.terms import TERMS

NEARLY_1 = 1 - 1e-6  # a mean with a factor of 1 would never move


@dataclass(frozen=True)
class Network:
    """The network (x, y, t) -> fields."""

    widths: tuple[int, ...] = setting(
        (128, 128, 128, 128), "widths of the hidden layers", low=1, high=2**16
    )
    initialization: Literal["wide", "glorot_uniform"] = setting(
        "wide",
        "first parameters: wide (first layer of unit variance, hidden gain 1.4) or Glorot uniform",
    )
    pressure_scale: float = setting(
        0.2, "pressure of an output of 1, in units of the flow", low=TINY
    )


@dataclass(frozen=True)
class Rheology:
    """The parameters of the friction law as unknowns."""

    variables: Literal["log", "sigmoid"] = setting(
        "log",
        "what is optimised in place of a parameter: its logarithm, as the law states it (log), or "
        "the argument of a sigmoid, which keeps it between 0 and 1",
    )
    random_start: bool = setting(
        False, "draw the start values of the free parameters at random; else those of the law"
    )
    fix: tuple[str, ...] | None = setting(
        None,
        "values of parameters that the law holds fixed, such as mu_inf=0.04,alpha=1.8; none: those "
        "of the law, or of the flow; I0 has the flag --I0",
        metavar="NAME=X,...",
    )
    p_floor: float = setting(1e-6, "smallest pressure in I = d gamma_dot / sqrt(p)", low=TINY)

    @property
    def fixed(self) -> dict[str, float]:
        """The values of `fix` by name; ConfigError where one is no NAME=NUMBER."""
        values = {}
        for text in self.fix or ():
            name, _, number = text.partition("=")
            try:
                values[name.strip()] = float(number)
            except ValueError:
                raise ConfigError(
                    f"--rheology.fix must be NAME=NUMBER,..., such as mu_inf=0.04, got {text!r}"
                ) from None
        return values


_Sigmas: Any = make_dataclass(
    "_Sigmas",
    [
        (f"sigma_{term.name}", float, setting(term.sigma, term.help, low=1e-9, high=math.inf))
        for term in TERMS
    ],
    frozen=True,
)


@dataclass(frozen=True)
class Weights(_Sigmas):  # type: ignore[misc]  # one field sigma_<name> for each row of TERMS
    """Standard deviation sigma of each residual: a term weighs 1/sigma^2, inf leaves it out."""

    law_error: float = setting(
        0.02,
        "relative error of the friction law that is expected: where grains are so fast that it "
        "exceeds the sigma of the law, the law counts by its relative error; 0: nowhere",
        low=0,
        high=1,
    )
    follow_noise: bool = setting(
        True, "raise sigma_velocity with the noise that is measured in the vectors"
    )

    def sigma(self, term: str) -> float:
        """The standard deviation of a term of the loss, by its name."""
        return float(getattr(self, f"sigma_{term}"))


@dataclass(frozen=True)
class SideWalls:
    """Friction on the two side walls of a narrow channel, where the flow file has `wall_gap`.

    The mean and the standard deviation are those of the range 0.05 to 0.17 of the literature.
    """

    friction: float = setting(
        0.11,
        "friction coefficient of the grains on the side walls, where the flow file states "
        "wall_gap; 0: smooth walls",
        low=0,
        high=2,
    )
    friction_sd: float = setting(
        0.035,
        "standard deviation of this friction, for the error bars",
        low=0,
        high=2,
        free=True,
    )


@dataclass(frozen=True)
class Batch:
    """Points of one step, drawn with replacement as a function of (seed, step)."""

    interior: int = setting(1024, "points inside the grains", low=1, high=2**31)
    surface: int = setting(64, "points on the free surface", low=0, high=2**31)
    collocation: float = setting(
        1.0,
        "random points between the vectors of a grid, for the equations alone, per vector",
        low=0,
        high=100,
    )


@dataclass(frozen=True)
class Optimizer:
    """How the loss is minimised."""

    method: Literal["adam", "muon"] = setting(
        "muon", "adam everywhere, or Muon on the hidden matrices and adam elsewhere"
    )
    learning_rate: float = setting(4e-3, "learning rate of adam", low=0, high=1e3)
    muon_learning_rate: float = setting(4e-2, "learning rate of Muon", low=0, high=1e3)
    scalars_learning_rate: float = setting(
        1e-2, "learning rate of the parameters of the friction law", low=0, high=1e3
    )
    final_fraction: float = setting(
        0.0, "every learning rate at the end, relative to its peak", low=0, high=1
    )
    warm_up: float = setting(
        0.017, "part of each stage in which learning rates rise from 0", low=0, high=0.5
    )
    prefit: float = setting(
        0.15, "part of the run, at its start, that fits the velocity alone", low=0, high=0.99
    )
    beta_2: float = setting(0.99, "decay of the second moment of adam", low=0, high=NEARLY_1)
    epsilon: float = setting(1e-8, "epsilon of adam", low=TINY, high=1)
    momentum: float = setting(0.95, "momentum of Muon", low=0, high=NEARLY_1)
    last_layer: bool = setting(
        True, "end with Gauss-Newton steps in the last layer and the friction law (mixed form)"
    )
