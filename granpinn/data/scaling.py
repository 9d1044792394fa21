"""The scales of a flow, and the constants of its material for the equations."""

from __future__ import annotations

import math

import numpy as np

from granpinn.data.flow import Flow, FlowFileError
from granpinn.physics.scales import Material, Scales


def scales_of(flow: Flow) -> Scales:
    """The scales of a flow of grains under gravity, from its height in the first frame.

    Raises:
        FlowFileError: the flow has no grains in its first frame, or a scale is not positive.
    """
    try:
        return Scales.of(initial_height(flow), flow.gravity, flow.density)
    except FlowFileError:
        raise
    except ValueError as error:
        raise FlowFileError(str(error)) from None


def material_of(flow: Flow, scales: Scales) -> Material:
    """The constants of the material of a flow, dimensionless."""
    g = math.hypot(*flow.gravity)
    grain_density = flow.density if flow.grain_density is None else flow.grain_density
    effective = flow.grain_diameter * math.sqrt(grain_density / flow.density)

    def viscosity(eta: float | None) -> float | None:
        return None if eta is None else scales.to_dimensionless(eta, "viscosity")

    return Material(
        grain_diameter=scales.to_dimensionless(effective, "length"),
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
