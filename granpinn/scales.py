r"""The only place that makes things dimensionless and back.

Length $H_0$ (height of the grains in the first frame), velocity $U = \sqrt{|g| H_0}$, time
$H_0/U$, pressure $P = \rho |g| H_0$. In these units $\rho = 1$ and $|g| = 1$, and the grain
diameter, the bounds of the viscosity and the friction law are all that is left of the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, cast

import numpy as np
import numpy.typing as npt

from granpinn.data.flow import Flow, FlowFileError

Quantity = Literal["length", "velocity", "time", "pressure", "rate", "viscosity", "acceleration"]
Values = TypeVar("Values")


@dataclass(frozen=True)
class Material:
    r"""What the equations need to know about the material, dimensionless.

    `grain_diameter` is $d \sqrt{\rho_g / \rho} / H_0$: the equations have one density, the bulk
    density $\rho = 1$, but the inertial number $I = d \dot\gamma / \sqrt{p / \rho_g}$ has that of
    a grain. The paper sets both equal, as does a file without `grain_density`.
    """

    grain_diameter: float
    gravity: tuple[float, float]
    eta_min: float | None
    eta_max: float | None


@dataclass(frozen=True)
class Scales:
    """Units of length, velocity, time and pressure, each in the units of the flow file."""

    length: float
    velocity: float
    time: float
    pressure: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise FlowFileError(
                    f"the scale of {name} must be positive and finite, got {value}: check the "
                    "units of the flow"
                )

    @classmethod
    def from_flow(cls, flow: Flow) -> Scales:
        """The scales of a column collapse (or any flow of grains under gravity)."""
        length = initial_height(flow)
        g = math.hypot(*flow.gravity)
        velocity = math.sqrt(g * length)
        return cls(length, velocity, length / velocity, flow.density * g * length)

    def unit(self, quantity: Quantity) -> float:
        """The size of one dimensionless unit of a quantity, in the units of the flow file."""
        units: dict[Quantity, float] = {
            "length": self.length,
            "velocity": self.velocity,
            "time": self.time,
            "pressure": self.pressure,
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

    def points_to_dimensionless(self, x: Any, y: Any, t: Any) -> npt.NDArray[np.float64]:
        """Points [..., 3] = (x, y, t), dimensionless, of positions and times in file units."""
        points = np.stack(np.broadcast_arrays(x, y, t), axis=-1, dtype=np.float64)
        points /= np.array([self.length, self.length, self.time])
        return points

    def points_to_physical(self, points: Any) -> npt.NDArray[np.float64]:
        """The inverse of points_to_dimensionless: [..., 3] = (x, y, t) in file units."""
        physical: npt.NDArray[np.float64] = np.asarray(points, dtype=np.float64) * np.array(
            [self.length, self.length, self.time]
        )
        return physical

    def material(self, flow: Flow) -> Material:
        """The constants of the material in these units."""
        g = math.hypot(*flow.gravity)
        grain_density = flow.density if flow.grain_density is None else flow.grain_density
        effective = flow.grain_diameter * math.sqrt(grain_density / flow.density)

        def viscosity(eta: float | None) -> float | None:
            return None if eta is None else self.to_dimensionless(eta, "viscosity")

        return Material(
            grain_diameter=self.to_dimensionless(effective, "length"),
            gravity=(flow.gravity[0] / g, flow.gravity[1] / g),
            eta_min=viscosity(flow.eta_min),
            eta_max=viscosity(flow.eta_max),
        )


def initial_height(flow: Flow) -> float:
    """Extent of the cells full of grains in the first frame, measured against gravity.

    From the lowest to the highest cell center with c = 1, and half a cell on either side; for
    scattered vectors from the lowest to the highest of the first time, and half a grain.
    """
    if flow.particles is not None:
        p = flow.particles
        first = p.t == p.t.min()
        return float(np.ptp(flow.height(p.x[first], p.y[first]))) + flow.grain_diameter
    rows, columns = np.nonzero(flow.material[0])
    if rows.size == 0:
        raise FlowFileError(
            "c must be 1 at some point of the first frame, got none: the height of the grains "
            "there sets the length scale"
        )
    h = flow.height(flow.x[columns], flow.y[rows])
    spacing = (float(np.median(np.diff(axis))) for axis in (flow.x, flow.y))
    g = math.hypot(*flow.gravity)
    cell = sum(abs(g_i) / g * d_i for g_i, d_i in zip(flow.gravity, spacing, strict=True))
    return float(h.max() - h.min()) + cell
