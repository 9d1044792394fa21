r"""Synthetic pictures of grains: seeded, moved with a velocity field, filmed by a noisy camera.

A grain at $(x_i, y_i)$ is a Gaussian spot, $A_i \exp(-|r - r_i|^2 / 2 \sigma^2)$ with
$\sigma = 0.9$ px, about the size of a grain of 2.5 px; above the free surface it is dark. The
brightness A_i varies from grain to grain. A part of the grains is in one picture of a pair only,
because grains turn and move out of the light; noise is that of reading (constant) and of photons
(its variance grows with the light); pictures have 8 bits. The left and the lower edge of the
picture are the wall and the bed. Everything is NumPy, and a function of the seed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from bench.studies.experiment.velocity_field import VelocityField

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]
Random = np.random.Generator


@dataclass(frozen=True)
class Camera:
    """A camera that looks at the flow straight from the side.

    Attributes:
        pixel: size of a pixel, in the unit of length of the flow.
        rows, columns: of the picture; rows a multiple of 8.
        sigma: radius of a spot, px; spacing: mean distance of grains, px.
        brightness: of the brightest grain, grey levels; dark: grey level without light.
        read, photon: variance of a grey level is read^2 + photon * light.
        lost: part of the grains that are in one picture of a pair only.
    """

    pixel: float
    rows: int
    columns: int
    sigma: float = 0.9
    spacing: float = 2.6
    brightness: float = 110.0
    dark: float = 8.0
    read: float = 2.0
    photon: float = 0.2
    lost: float = 0.04


def seed_grains(field: VelocityField, t: float, camera: Camera, random: Random) -> Array:
    """Positions [2, n] of grains at time t, one in every square of `spacing` inside the grains.

    One in each square, anywhere in it: as evenly filled as a packing, without a lattice.
    """
    s = camera.spacing
    i, j = np.meshgrid(np.arange(camera.columns // s + 1), np.arange(camera.rows // s + 1))
    corners = np.stack([i.ravel(), j.ravel()])
    points = (corners + random.random(corners.shape)) * s * camera.pixel
    return np.asarray(points[:, field.fraction(t, *points) > 0.5])


def advect(field: VelocityField, points: Array, t: float, span: float) -> Array:
    """Where grains at `points` [2, n] at time t are after `span` (before, if negative): midpoint
    rule, whose error is far below that of the PIV for a span of a few pixels of motion."""
    half = points + 0.5 * span * field.velocity(t, *points)
    return np.asarray(points + span * field.velocity(t + 0.5 * span, *half))


def render(points: Array, brightness: Array, camera: Camera) -> Array:
    """Light [rows, columns] of grains at points [2, n] (x, y up, in px from the lower left corner).

    The value of a pixel is that of the spots at its center; rows run from the top.
    """
    x, y = points[0], camera.rows - points[1]
    reach = int(np.ceil(4 * camera.sigma))
    offsets = np.arange(-reach, reach + 1)
    column = np.floor(x).astype(int)[:, None] + offsets
    row = np.floor(y).astype(int)[:, None] + offsets
    in_x = np.exp(-0.5 * ((column + 0.5 - x[:, None]) / camera.sigma) ** 2)
    in_y = np.exp(-0.5 * ((row + 0.5 - y[:, None]) / camera.sigma) ** 2)
    spots = brightness[:, None, None] * in_y[:, :, None] * in_x[:, None, :]
    rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    there = (rows >= 0) & (rows < camera.rows) & (columns >= 0) & (columns < camera.columns)
    index = rows[there] * camera.columns + columns[there]
    light = np.bincount(index, spots[there], minlength=camera.rows * camera.columns)
    return np.asarray(light.reshape(camera.rows, camera.columns))


def expose(light: Array, camera: Camera, random: Random) -> Image:
    """What the camera makes of light: noise, offset, 8 bits."""
    deviation = np.sqrt(camera.read**2 + camera.photon * light)
    levels = camera.dark + light + deviation * random.standard_normal(light.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def take_pair(
    field: VelocityField, t: float, delay: float, camera: Camera, random: Random
) -> tuple[Image, Image]:
    """Two pictures at t - delay / 2 and t + delay / 2."""
    middle = seed_grains(field, t, camera, random)
    brightness = camera.brightness * random.uniform(0.15, 1.0, size=(middle.shape[1],))
    # A share of lost / 2 is missing in each picture.
    fate = random.random(middle.shape[1])
    pictures = []
    for sign, seen in ((-1, fate > camera.lost / 2), (1, fate < 1 - camera.lost / 2)):
        points = advect(field, middle, t, 0.5 * sign * delay) / camera.pixel
        light = render(points[:, seen], brightness[seen], camera)
        pictures.append(expose(light, camera, random))
    return pictures[0], pictures[1]


def smoothed(image: npt.NDArray[Any], sigma: float) -> Array:
    """Gaussian mean of an image, mirrored at its edges."""
    image = np.asarray(image, np.float64)
    return np.asarray(ndimage.gaussian_filter(image, sigma, mode="reflect", truncate=3))


def grain_level(pair: tuple[Image, Image], sigma: float = 4.0) -> Array:
    """Mean brightness of a pair around each pixel: 1 inside the grains, 0 outside.

    At a straight edge it is 1/2, also at one that moves, because both pictures count alike.
    """
    mean = smoothed(0.5 * (pair[0].astype(np.float64) + pair[1]), sigma)
    dark, bright = np.percentile(mean, 1), mean.max()
    inside = np.median(mean[mean > 0.5 * (dark + bright)])
    return np.asarray((mean - dark) / (inside - dark))


def surface_points(level: Array) -> Array:
    """Points [2, n] (x, y up, in px from the lower left corner) of the line where level = 1/2.

    Edges that face up or to the right: the wall is on the left, the bed below.
    """
    found = []
    # Along a column from the bed upwards; along a row from the wall to the right.
    for values, upwards in ((level[::-1], True), (level.T, False)):
        low, high = values[:-1], values[1:]
        place, other = np.nonzero((low > 0.5) & (high <= 0.5))
        share = (low[place, other] - 0.5) / (low[place, other] - high[place, other])
        along = place + 0.5 + share
        across = other + 0.5 if upwards else level.shape[0] - other - 0.5
        found.append(np.stack([across, along] if upwards else [along, across]))
    return np.concatenate(found, axis=1)
