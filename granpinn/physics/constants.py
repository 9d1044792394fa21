"""The constants of a problem that the kernels take, by name."""

from __future__ import annotations

import math
from typing import NamedTuple


class Physics(NamedTuple):
    """Constants of the equations, dimensionless; the fields and the order of csrc/math/physics.h.

    Attributes:
        grain_diameter: d of the inertial number (`granpinn.physics.scales.EquationConstants`).
        g_x, g_y: gravity, a unit vector.
        eta_min, eta_max: bounds of the viscosity.
        velocity_scale, pressure_scale: of the network's raw outputs.
        pressure_floor: smallest pressure under the root of I = d gamma_dot / sqrt(p).
        law_rate: shear rate above which the residual of the friction law is relative (mixed form).
        side_wall: k = 2 mu_w / W of the friction of side walls, a force -k p v / |v|; 0: none.
        side_wall_speed: s of its speed |v| = sqrt(u^2 + v^2 + s^2), which is smooth at rest.
        v_factor: factor on the scale of v: 0 of a flow in which v = 0 everywhere, else 1.
    """

    grain_diameter: float
    g_x: float
    g_y: float
    eta_min: float
    eta_max: float
    velocity_scale: float
    pressure_scale: float
    pressure_floor: float
    law_rate: float = math.inf
    side_wall: float = 0.0
    side_wall_speed: float = 1.0
    v_factor: float = 1.0

    @property
    def velocity_scales(self) -> tuple[float, float]:
        """The scales of the raw outputs u and v."""
        return self.velocity_scale, self.velocity_scale * self.v_factor
