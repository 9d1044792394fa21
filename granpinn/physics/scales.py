r"""The only place that makes things dimensionless and back (granpinn/data/scaling.py applies it).

Length $H_0$ (height of the grains in the first frame), velocity $U = \sqrt{|g| H_0}$, time
$H_0/U$, pressure $P = \rho |g| H_0$. In these units $\rho = 1$ and $|g| = 1$, and the grain
diameter, the bounds of the viscosity and the friction law are all that is left of the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, cast

import numpy as np

from granpinn.arrays import Float64

Quantity = Literal[
    "length", "velocity", "time", "pressure", "force", "rate", "viscosity", "acceleration"
]
Values = TypeVar("Values")


@dataclass(frozen=True)
class Scales:
    """Units of length, velocity, time and pressure, each in the units of the flow file.

    Attributes:
        origin: (x, y, t) of the dimensionless (0, 0, 0), in the units of the flow file.
    """

    length: float
    velocity: float
    time: float
    pressure: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("length", "velocity", "time", "pressure"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(
                    f"the scale of {name} must be positive and finite, got {value}: check the "
                    "units of the flow"
                )

    @classmethod
    def of(
        cls,
        length: float,
        gravity: tuple[float, float],
        density: float,
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Scales:
        """The units of grains of this bulk density that stand `length` high under `gravity`."""
        g = math.hypot(*gravity)
        velocity = math.sqrt(g * length)
        return cls(length, velocity, length / velocity, density * g * length, origin)

    def unit(self, quantity: Quantity) -> float:
        """The size of one dimensionless unit of a quantity, in the units of the flow file."""
        units: dict[Quantity, float] = {
            "length": self.length,
            "velocity": self.velocity,
            "time": self.time,
            "pressure": self.pressure,
            "force": self.pressure / self.length,
            "rate": 1 / self.time,
            "viscosity": self.pressure * self.time,
            "acceleration": self.velocity / self.time,
        }
        if quantity not in units:
            raise ValueError(f"quantity must be one of {', '.join(units)}, got {quantity!r}")
        return units[quantity]

    def to_dimensionless(self, values: Values, quantity: Quantity) -> Values:
        """Numbers, arrays or tensors from the units of the flow file; NaN stays NaN."""
        return cast(Values, cast(Any, values) / self.unit(quantity))

    def to_physical(self, values: Values, quantity: Quantity) -> Values:
        """The inverse of to_dimensionless."""
        return cast(Values, cast(Any, values) * self.unit(quantity))

    def points_to_dimensionless(self, x: Any, y: Any, t: Any) -> Float64:
        """Points [..., 3] = (x, y, t), dimensionless, of positions and times in file units."""
        points = np.stack(np.broadcast_arrays(x, y, t), axis=-1, dtype=np.float64)
        points -= np.array(self.origin)
        points /= np.array([self.length, self.length, self.time])
        return points

    def points_to_physical(self, points: Any) -> Float64:
        """The inverse of points_to_dimensionless: [..., 3] = (x, y, t) in file units."""
        units = np.array([self.length, self.length, self.time])
        physical: Float64 = np.asarray(points, dtype=np.float64) * units + np.array(self.origin)
        return physical
