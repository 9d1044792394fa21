r"""The constants of a problem that the kernels take, by name.

Friction of the two side walls of a narrow channel, as a body force against the velocity.

The flow is the mean over the gap W between the walls. Each wall carries the stress $\mu_w p$
against the motion, so that the force per volume is

$$ f = -\frac{2 \mu_w}{W}\, p\, \frac{v}{|v|} $$

(Jop, Forterre and Pouliquen 2005, J. Fluid Mech. 541, 167-192).

Deviation: $|v|^2 = u^2 + v^2 + s^2$ with a small speed s, a hundredth of the rms speed of the flow.
Grains at rest feel any force up to $\mu_w p$ per wall; s makes the force smooth there. It weakens
the friction by 0.5 % at a tenth of the rms speed and by a third at a hundredth of it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from torch import Tensor

AT_REST = 0.01  # s over the rms speed


def side_wall(friction: float, gap: float) -> float:
    """k = 2 mu_w / W, the force over the pressure, per unit of the length of `gap`."""
    return 2 * friction / gap


class Physics(NamedTuple):
    """Constants of the equations, dimensionless; the fields and the order of csrc/math/physics.h.

    Attributes:
        grain_diameter: d of the inertial number (`data.scaling.inertial_diameter`).
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

    def inertial_number(self, gamma_dot: Tensor, p: Tensor) -> Tensor:
        """I = d gamma_dot / sqrt(max(|p|, p_floor)), equation (1) of the paper with rho_g = 1.

        Args:
            gamma_dot: shear rate sqrt(2 D:D) of any shape.
            p: pressure of the same shape. Below the floor I no longer grows: it is finite at p = 0.
        """
        root = p.abs().clamp(min=self.pressure_floor).sqrt()
        return self.grain_diameter * gamma_dot / root
