"""The flow file of a scene: velocity, c, the surface line, walls, gravity, diameter, bulk density.

It has what a camera would give, and no stress. The averaging kernel is an attribute.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench.studies.grains.coarse import SD, YY, Fields
from bench.studies.grains.materials import I0, Material
from bench.studies.grains.scenes.scene import Scene
from bench.studies.grains.surface import KEPT, UNCERTAINTY
from bench.studies.grains.walls import plate_height, walls_of
from granpinn.arrays import Bool, Float64
from granpinn.data import Flow, Surface, Truth


def flow_of(
    scene: Scene,
    material: Material,
    fields: Fields,
    c: Float64,
    height: Float64 | None,
    truth: Mapping[str, float] | None,
    origin: Mapping[str, float | str],
) -> Flow:
    """What is known of a scene from outside, in the format of a flow file.

    Args:
        c: volume fraction of the cells, [T, Y, X].
        height: of the surface line, [T, X], or None.
        truth: mu_s and mu_2 of the shear cell, or None.
        origin: further attributes, such as the name of the scene.
    """
    vector = (fields.phi > KEPT * fields.bulk) & (fields.coverage > 0.3)
    vector &= np.isfinite(fields.u) & np.isfinite(fields.v)
    u, v = (np.where(vector, a, np.nan).astype(np.float32) for a in (fields.u, fields.v))
    surface = None
    if height is not None:
        frame, column = np.nonzero(np.isfinite(height))
        surface = Surface(fields.t[frame], fields.x[column], height[frame, column])
    stated = {
        "solid_fraction": scene.shape.fraction,
        "window": "Gaussian, cut at 3 standard deviations",
        "window_sd": SD,
        "source": "discrete elements (LAMMPS), bench.studies.grains",
        "grain_friction": material.friction,
    }
    stated |= {} if surface is None else {"surface_sd": UNCERTAINTY}
    stated |= {"steady": 1} if scene.steady and not scene.filmed else {}
    plate = plate_height(scene.attributes, fields.stress[..., YY], fields.y)
    return Flow(
        t=fields.t,
        y=fields.y,
        x=fields.x,
        u=u,
        v=v,
        c=c.astype(np.float32),
        gravity=scene.gravity,
        density=scene.shape.bulk_density,
        grain_diameter=1.0,
        surface=surface,
        walls=walls_of(scene.attributes, fields.x, fields.y, plate),
        truth=None if truth is None else Truth(mu_s=truth["mu_s"], mu_2=truth["mu_2"], I0=I0),
        attributes=stated | scene.attributes | dict(origin),
    )


def cropped(fields: Fields, like: Fields | None = None) -> Fields:
    """Without the rows and columns of cells that never hold grains in these fields, or in those
    of `like`."""
    held = like or fields
    there = held.phi > KEPT * held.bulk
    rows, columns = _extent(there, (0, 2)), _extent(there, (0, 1))
    cut = (slice(None), rows, columns)
    return replace(
        fields,
        y=fields.y[rows],
        x=fields.x[columns],
        phi=fields.phi[cut],
        rho=fields.rho[cut],
        u=fields.u[cut],
        v=fields.v[cut],
        stress=fields.stress[cut],
        coverage=fields.coverage[rows, columns],
    )


def _extent(there: Bool, others: tuple[int, int]) -> slice:
    """From the first to the last True along an axis, and one more cell on either side."""
    found = np.flatnonzero(np.any(there, axis=others))
    return slice(max(0, int(found[0]) - 1), int(found[-1]) + 2)
