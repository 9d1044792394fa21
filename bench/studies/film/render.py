r"""Films of simulated flows: textured grains that the true velocity field moves and turns.

A grain is a disc with its own brightness, shading and spots; the spots turn with it. Its center
follows the velocity field of the simulation by the midpoint rule, $\dot r_i = v(t, r_i)$, and it
turns with half of the vorticity there: a feature at the edge of a grain therefore does not have the
velocity of the field, as in films of real grains. Nearer grains hide the ones behind them. The
camera adds uneven light, blur, noise of reading and of photons, and 8 bits.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import gaussian_filter

from bench.studies.experiment.velocity_field import Array, VelocityField

Picture = npt.NDArray[np.uint8]

FINE = 2  # points of a grain per pixel, along an axis
SPOTS = 3  # of a grain


@dataclass(frozen=True)
class Shot:
    """How a flow is filmed.

    Attributes:
        pixel: m; grain: diameter, px; rate: frames per second.
        first, frames: number of the first frame after the release (negative: before it), and count.
        rows, columns: of the picture, px. Its lower left corner is the origin of the flow.
        light: brightness of the left edge relative to the right one; background: grey level.
        blur: standard deviation, px; exposure: part of the time between frames.
        read, photon: variance of a grey level is read^2 + photon * light.
        period: m, after which the sides repeat; None: walls.
    """

    pixel: float
    grain: float
    rate: float
    first: int
    frames: int
    rows: int
    columns: int
    seed: int
    light: float = 0.75
    background: float = 12.0
    blur: float = 0.6
    exposure: float = 0.2
    read: float = 2.0
    photon: float = 0.15
    period: float | None = None


@dataclass
class Grains:
    place: Array  # [2, n], m
    angle: Array  # [n]
    radius: Array  # [n], px
    bright: Array
    spots: Array  # [n, SPOTS, 3]: distance in radii, angle, strength

    def those(self, kept: Any) -> Grains:
        """The grains of a mask [n]."""
        place, *others = (getattr(self, field.name) for field in dataclasses.fields(self))
        return Grains(place[:, kept], *(values[kept] for values in others))


def frames(field: VelocityField, shot: Shot) -> Iterator[Picture]:
    """The frames of a film, a function of the seed."""
    random = np.random.default_rng([shot.seed, 54])
    t = max(shot.first, 0) / shot.rate
    grains = seeded(field, t, shot, random)
    for k in range(shot.first, shot.first + shot.frames):
        now = max(k / shot.rate, 0.0)
        grains = moved(field, grains, t, now - t, shot)
        t = now
        span = shot.exposure / shot.rate / 3 if k >= 0 else 0.0
        sides = [field.advect(grains.place, t, s * span) for s in (-1, 1)] if span else []
        yield exposed([grains.place, *sides], grains, shot, random)


def write(field: VelocityField, shot: Shot, folder: Path) -> Path:
    """The film as PNG files; the pattern of their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, picture in enumerate(frames(field, shot)):
        Image.fromarray(picture).save(folder / f"frame_{k:05d}.png", compress_level=1)
    return folder / "frame_*.png"


def seeded(field: VelocityField, t: float, shot: Shot, random: np.random.Generator) -> Grains:
    """One grain in every square of 0.85 diameters: the picture of the inside has few gaps."""
    side = 0.85 * shot.grain * shot.pixel
    wide, high = shot.columns * shot.pixel, shot.rows * shot.pixel
    i, j = np.meshgrid(np.arange(-1, wide // side + 2), np.arange(-1, high // side + 2))
    corners = np.stack([i.ravel(), j.ravel()])
    place: Any = (corners + random.random(corners.shape)) * side
    place = place[:, (field.fraction(t, *place) > 0.5) & (place[1] > 0)]
    n = place.shape[1]
    spots = np.stack(
        [
            random.uniform(0.2, 0.8, (n, SPOTS)),
            random.uniform(0, 2 * np.pi, (n, SPOTS)),
            random.uniform(-0.6, 0.6, (n, SPOTS)),
        ],
        axis=-1,
    )
    radius = 0.5 * shot.grain * random.uniform(0.85, 1.15, n)
    return Grains(place, random.uniform(0, 2 * np.pi, n), radius, random.uniform(70, 170, n), spots)


def moved(field: VelocityField, grains: Grains, t: float, span: float, shot: Shot) -> Grains:
    """All grains moved and turned; several midpoint steps of at most a pixel or so."""
    steps, e, grains = 4, shot.pixel * shot.grain, dataclasses.replace(grains)
    for k in range(steps):
        now, dt = t + span * k / steps, span / steps
        x, y = grains.place
        v_x = field.velocity(now, x + e, y)[1] - field.velocity(now, x - e, y)[1]
        u_y = field.velocity(now, x, y + e)[0] - field.velocity(now, x, y - e)[0]
        grains.angle = grains.angle + dt * 0.5 * (v_x - u_y) / (2 * e)
        grains.place = field.advect(grains.place, now, dt)
        if shot.period is not None:
            grains.place[0] = np.mod(grains.place[0], shot.period)
    return grains


def exposed(
    places: Sequence[Array], grains: Grains, shot: Shot, random: np.random.Generator
) -> Picture:
    """What the camera makes of grains that are at these places [2, n] while the shutter is open."""
    light = np.mean([_light(dataclasses.replace(grains, place=p), shot) for p in places], axis=0)
    light = gaussian_filter(light, shot.blur) * np.linspace(shot.light, 1, shot.columns)
    noise = np.sqrt(shot.read**2 + shot.photon * light) * random.standard_normal(light.shape)
    return np.asarray(np.clip(np.rint(light + noise), 0, 255), np.uint8)


def _light(grains: Grains, shot: Shot) -> Array:
    """Light [rows, columns]: grains one over the other, row 0 at the top."""
    rows, columns = shot.rows * FINE, shot.columns * FINE
    picture = np.full(rows * columns, shot.background, np.float32)
    x, y = grains.place / shot.pixel * FINE
    y = rows - y
    reach = int(np.ceil(grains.radius.max() * FINE)) + 1
    offset = np.arange(-reach, reach + 1)
    for part in np.array_split(np.arange(x.size), max(1, x.size // 2000)):
        i, j = np.floor(x[part]).astype(int), np.floor(y[part]).astype(int)
        r = (grains.radius[part] * FINE)[:, None, None].astype(np.float32)
        a = ((i - x[part] + 0.5)[:, None, None] + offset[None, None, :]).astype(np.float32) / r
        b = ((j - y[part] + 0.5)[:, None, None] + offset[None, :, None]).astype(np.float32) / r
        square = a * a + b * b
        value = 1 - 0.5 * square + 0.35 * np.exp(-8 * ((a + 0.3) ** 2 + (b + 0.3) ** 2))
        for k in range(SPOTS):
            distance, phase, strength = grains.spots[part, k].T
            phase = phase - grains.angle[part]  # rows point down
            p, q = (
                (distance * f(phase)).astype(np.float32)[:, None, None] for f in (np.cos, np.sin)
            )
            spot = np.exp(-12 * ((a - p) ** 2 + (b - q) ** 2))
            value += strength.astype(np.float32)[:, None, None] * spot
        value *= grains.bright[part].astype(np.float32)[:, None, None]
        row = (j[:, None, None] + offset[None, :, None]) + np.zeros_like(offset)[None, None, :]
        column = (i[:, None, None] + offset[None, None, :]) + np.zeros_like(offset)[None, :, None]
        seen = (square < 1) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        # Of several values at a point the last one stays: later grains are nearer.
        picture[row[seen] * columns + column[seen]] = np.maximum(value[seen], 0)
    fine = picture.reshape(shot.rows, FINE, shot.columns, FINE)
    light: Any = fine.mean(axis=(1, 3), dtype=np.float64)
    return np.asarray(light)
