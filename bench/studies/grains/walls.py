"""The walls of the scenes in the flow file.

They follow from what a scene states of itself: glued grains half a diameter behind the line at
which `inside` of the scene ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Walls

CORNERS = 120  # of the polygon that stands for a drum
STICKS, SLIPS = 0.0, 1.0


def walls_of(
    stated: Mapping[str, Any], x: Float64, y: Float64, plate: float | None = None
) -> Walls | None:
    """The walls of a scene; None if its attributes name none.

    Args:
        stated: attributes of the scene.
        x, y: axes of its flow file.
        plate: its height (`plate_height`).
    """
    if "wall_radius" in stated:
        return _drum(float(stated["wall_radius"]), float(stated["wall_rotation"]))
    far = float(x[-1]) + (x[1] - x[0]) / 2
    high = float(y[-1]) + (y[1] - y[0]) / 2
    if "outlet_width" in stated:
        half, gap = float(stated["wall_x"]), float(stated["outlet_width"]) / 2
        side = ((half, high), (half, 0.0), (gap, 0.0))
        left = tuple((-a, b) for a, b in side)
        return _lines((side, STICKS), (left, STICKS))
    if "plate_load" in stated:
        return _under_plate(stated, plate)
    if "slope" in stated:
        return _lines((((0.0, 0.0), (float(stated["period_x"]), 0.0)), STICKS))
    if "column_width" in stated:
        return _lines((((0.0, 0.0), (far, 0.0)), STICKS), (((0.0, 0.0), (0.0, high)), SLIPS))
    if str(stated.get("walls", "")).startswith("y = 0"):
        return _lines((((float(x[0]) - (x[1] - x[0]) / 2, 0.0), (far, 0.0)), STICKS))
    return None


def _under_plate(stated: Mapping[str, Any], plate: float | None) -> Walls:
    """The bed, and the plate with its load; without `plate` the bed alone."""
    far, load, speed = (float(stated[k]) for k in ("period_x", "plate_load", "plate_speed"))
    bed = _lines((((0.0, 0.0), (far, 0.0)), STICKS))
    if plate is None:
        return bed
    nan = math.nan
    return Walls(
        x=np.array([0, far, nan, 0, far]),
        y=np.array([0, 0, nan, plate, plate]),
        u=np.array([0, 0, nan, speed, speed]),
        v=np.array([0, 0, nan, 0, 0]),
        slip=np.array([STICKS, STICKS, nan, STICKS, STICKS], np.float32),
        p=np.array([nan, nan, nan, load, load], np.float32),
    )


def plate_height(stated: Mapping[str, Any], sigma_yy: Float64, y: Float64) -> float | None:
    """Height of the plate, where the stress [T, Y, X] of the grains reaches its load; None without.

    An experiment reads it from its plate.
    """
    if "plate_load" not in stated:
        return None
    normal = np.nanmean(sigma_yy, axis=(0, 2))
    slope, start = np.polyfit(y, normal, 1)
    return float((float(stated["plate_load"]) - start) / slope)


def _drum(radius: float, rate: float) -> Walls:
    """A circle around the origin that turns counterclockwise."""
    angle = np.linspace(0, 2 * math.pi, CORNERS + 1)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    x[-1], y[-1] = x[0], y[0]
    return Walls(x=x, y=y, u=-rate * y, v=rate * x, slip=np.full(x.size, STICKS, np.float32))


def _lines(*pieces: tuple[tuple[tuple[float, float], ...], float]) -> Walls:
    """Walls at rest; every piece has its points and whether grains slip on it."""
    rows: list[tuple[float, float, float]] = []
    for points, slip in pieces:
        rows += [*([(math.nan,) * 3] if rows else []), *((*point, slip) for point in points)]
    x, y, slips = np.array(rows).T
    return Walls(x=x.copy(), y=y.copy(), slip=slips.astype(np.float32))
