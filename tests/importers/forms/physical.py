"""The physical flow of all forms, in SI: the scene, without any reader of granpinn."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from granpinn.data import Flow, Particles, Surface, Walls, particle_flow
from granpinn.importers import Validity
from granpinn.importers.surface import from_fraction
from tests.importers import scene

METERS = replace(scene.METERS, up=True)
T = (np.arange(scene.FRAMES) + 0.5) * scene.SI["frame"]
SETTINGS: dict[str, Any] = {
    "scale": "0.5 mm/px",
    "frame_rate": "500 Hz",
    "grain_diameter": "2 mm",
    "grain_density": "2500 kg/m^3",
    "solid_fraction": 0.6,
}
G = 9.81
MATERIAL: dict[str, Any] = {
    "gravity": (0.0, -G),
    "density": 1500.0,
    "grain_density": 2500.0,
    "grain_diameter": 0.002,
    "length_unit": "m",
    "time_unit": "s",
    "density_unit": "kg/m^3",
}


def measured(gaps: bool = True) -> Any:
    """Vectors [T, Y, X] that count, rows from the top; without gaps all among the grains."""
    return scene.codes() == Validity.VALID if gaps else scene.codes() != Validity.MASKED


def flow(*, gaps: bool = True, fraction: bool = False, line: bool = False, **others: Any) -> Flow:
    """The scene as a flow on a grid.

    Args:
        gaps: whether the instrument lost some vectors.
        fraction: whether the volume fraction is known; partly filled cells then have vectors.
        line: whether the free surface is given as points, else it is the edge of the grains.
        others: fields of Flow to replace.
    """
    return replace(_flow(gaps, fraction, line), **others)


@cache
def _flow(gaps: bool, fraction: bool, line: bool) -> Flow:
    c = scene.fraction() if fraction else (scene.codes() != Validity.MASKED).astype(float)
    there = measured(gaps) | ((c > 0) & (c < 1))
    x, y = METERS.axes()
    u, v = (np.where(there, a, np.nan)[:, ::-1] for a in METERS.velocity())
    c, y = np.asarray(c[:, ::-1], np.float32), y[::-1]
    surface = surface_line() if line else from_fraction(c.astype(float), T, y, x, (0, -G))
    return Flow(T, y, x, u, v, c, **MATERIAL, surface=surface)


def columns(gaps: bool = True, view: scene.View = METERS) -> dict[str, Any]:
    """t [s], frame, x, y, u, v [n] of all vectors that count."""
    frame, row, column = np.nonzero(measured(gaps))
    x, y = view.axes()
    u, v = (a[frame, row, column] for a in view.velocity())
    return {"t": T[frame], "frame": frame, "x": x[column], "y": y[row], "u": u, "v": v}


@cache
def scattered() -> Flow:
    """The scene as scattered vectors."""
    parts = columns()
    del parts["frame"]
    return of_particles(Particles(**parts))


def of_particles(particles: Particles, **others: Any) -> Flow:
    return replace(particle_flow(particles, **MATERIAL), **others)


def surface_line() -> Surface:
    """Points half a spacing above the uppermost grains of every column."""
    x, y = METERS.axes()
    frame, column = np.nonzero(np.ones((scene.FRAMES, scene.COLUMNS)))
    top = np.argmax(scene.codes() != Validity.MASKED, axis=1)
    return Surface(t=T[frame], x=x[column], y=y[top[frame, column]] + (y[0] - y[1]) / 2)


def walls() -> Walls:
    """A bed at rest, and a side wall that moves and carries a stress; nan between them."""
    nan = np.nan
    return Walls(
        x=np.array([0.001, 0.03, nan, 0.002, 0.003]),
        y=np.array([0.002, 0.001, nan, 0.001, 0.02]),
        u=np.array([0.0, 0.0, nan, 0.01, 0.02]),
        v=np.array([0.0, 0.0, nan, 0.25, 0.5]),
        slip=np.array([0, 0, nan, 1, 1], np.float32),
        p=np.array([nan, nan, nan, 20, 25], np.float32),
    )


def in_view(x: Any, y: Any, view: scene.View) -> tuple[Any, Any]:
    """Positions in SI as a view gives them."""
    places = []
    for values, own, axis in zip((x, y), METERS.axes(), view.axes(), strict=True):
        slope = (axis[1] - axis[0]) / (own[1] - own[0])
        places.append(axis[0] + slope * (values - own[0]))
    return places[0], places[1]


def without_units(flow: Flow) -> Flow:
    """The same numbers as a dimensionless flow."""
    return replace(flow, length_unit="1", time_unit="1", density_unit=None)
