r"""An estimate of the pressure, for the order of magnitude of the inertial number.

It follows from the momentum balance along the coordinate closest to gravity, without the stress
deviator:

$$ p(h) = \int_h^{h_s} \big(g_{eff}\big)\,\mathrm{d}h', \qquad
   g_{eff} = \max\big(-(g - \mathrm{D}v/\mathrm{D}t) \cdot e_h,\ 0\big): $$

The pressure is hydrostatic below the free surface, with a weight reduced by the acceleration.
Grains in free fall have no weight: without this reduction, I there would be several times too
small.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.estimates.gradients import Gradients
from granpinn.estimates.view import View
from granpinn.physics.axes import vertical_coordinate

# Least pressure, as a part of the weight of half a cell or half a grain.
FLOOR = 0.1


def estimated_pressure(view: View, found: Gradients) -> Float64:
    """Pressure at the cells of `found` [K], in units of rho |g| H0, above zero."""
    coordinate, downwards = vertical_coordinate(view.gravity)
    axis, component = 2 - coordinate, view.gravity[coordinate]
    spacing = view.steps[axis]
    weight = np.full(view.grains.shape, abs(component))
    along = found.acceleration[:, coordinate] * np.sign(component)
    weight[found.index] -= along
    weight = np.where(view.grains, weight, 0.0) * spacing
    # Downwards along the axis: from its end where the ground is at its beginning.
    ordered = weight if downwards else np.flip(weight, axis)
    below = np.cumsum(ordered, axis=axis) - ordered / 2
    pressure = below if downwards else np.flip(below, axis)
    least = FLOOR * max(spacing, view.d) / 2
    return np.maximum(pressure[found.index], least)


def inertial_number(view: View, found: Gradients, pressure: Float64) -> Float64:
    """I = d gamma_dot / sqrt(p) at the cells of `found` [K]."""
    return np.asarray(view.d * found.gamma_dot / np.sqrt(pressure))
