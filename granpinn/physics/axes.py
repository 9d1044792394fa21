r"""The axes in which a flow is trained: y against gravity, whatever camera looked at it.

A camera that is not level sees the same flow turned. If the network saw it turned too, it would be
another training of the same flow, and mu_s and mu_2 would differ by the scatter over seeds. Turned
back first, the training is the same, number by number. Beyond `LARGEST_TILT` the axes are taken for
those of a chute and stay: turned, its thin layer would lie askew in the input box of the network.

With the tilt $a$ of $g/|g| = (\sin a, -\cos a)$, R = [[cos a, sin a], [-sin a, cos a]] turns a
vector to these axes, and a stress is turned back by $R^T \tau R$.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

LARGEST_TILT = math.radians(10.0)


@dataclass(frozen=True)
class Axes:
    """The turn from the axes of the file to those of the training.

    Attributes:
        cos, sin: of the angle; 1 and 0 where nothing is turned.
        gravity: unit vector, in the axes of the training.
    """

    cos: float
    sin: float
    gravity: tuple[float, float]

    @classmethod
    def of(cls, gravity: tuple[float, float]) -> Axes:
        """The axes for a gravity in those of the file, of any size."""
        size = math.hypot(*gravity)
        g_x, g_y = (component / size for component in gravity)
        if g_x == 0 or abs(math.atan2(g_x, -g_y)) > LARGEST_TILT:
            return cls(1.0, 0.0, (g_x, g_y))
        return cls(-g_y, g_x, (0.0, -1.0))

    def turn(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Components of vectors, numbers, arrays or tensors, in the axes of the training."""
        if self.sin == 0:
            return x, y
        return self.cos * x + self.sin * y, self.cos * y - self.sin * x

    def undo(self, x: Any, y: Any) -> tuple[Any, Any]:
        """The inverse of `turn`."""
        return Axes(self.cos, -self.sin, self.gravity).turn(x, y)

    def undo_stress(self, tau_xx: Any, tau_xy: Any) -> tuple[Any, Any]:
        """A deviatoric stress [[tau_xx, tau_xy], [tau_xy, -tau_xx]] in the axes of the file."""
        # It turns twice as far as a vector.
        double = Axes(self.cos**2 - self.sin**2, 2 * self.cos * self.sin, self.gravity)
        return double.undo(tau_xx, tau_xy)
