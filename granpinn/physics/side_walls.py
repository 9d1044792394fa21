r"""Friction of the two side walls of a narrow channel, as a body force against the velocity.

The flow is the mean over the gap W between the walls. Each wall carries the stress $\mu_w p$
against the motion, so that the force per volume is

$$ f = -\frac{2 \mu_w}{W}\, p\, \frac{v}{|v|} $$

(Jop, Forterre and Pouliquen 2005, J. Fluid Mech. 541, 167-192).

Deviation: $|v|^2 = u^2 + v^2 + s^2$ with a small speed s, a hundredth of the rms speed of the flow.
Grains at rest feel any force up to $\mu_w p$ per wall; s makes the force smooth there. It weakens
the friction by 0.5 % at a tenth of the rms speed and by a third at a hundredth of it.
"""

from __future__ import annotations

AT_REST = 0.01  # s over the rms speed


def coefficient(friction: float, gap: float) -> float:
    """k = 2 mu_w / W, the force over the pressure, per unit of the length of `gap`."""
    return 2 * friction / gap
