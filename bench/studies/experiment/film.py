"""The simulated collapse of the experiment and the pictures that an imaginary camera takes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy import ndimage

from bench.studies.experiment.velocity_field import Array, VelocityField
from bench.studies.film.render import Picture, Shot, exposed, moved, seeded
from granpinn.data import Flow
from granpinn.simulation import Collapse, simulate

HEIGHT = 0.1  # m, of the column; its shape is that of the paper
GRAVITY = 9.81
FRACTION = 0.6  # of the volume: grains
GRAIN_DENSITY = 2500.0
FASTEST = 99.5  # percentile of the speed that makes the largest displacement
MARGIN = 16  # px of dark above and beside the grains
SEEN = 3.0  # px, diameter of a grain in the pictures, whatever that of the flow
LOST = 0.04  # part of the grains that are in one picture of a pair only


@dataclass(frozen=True, eq=False)
class Film:
    """Pairs of pictures of grains of a diameter: at times[k], `delay` apart, in `folder`."""

    grain: float
    field: VelocityField
    camera: Shot
    times: Sequence[float]
    delay: float
    folder: Path


def column(cells: int, frames: int, like: Collapse) -> Flow:
    """A collapse in SI units, 0.1 m high, with every cell of the grid."""
    scale = HEIGHT / like.height
    return simulate(
        dataclasses.replace(
            like,
            d=like.d * scale,
            height=HEIGHT,
            box_width=None if like.box_width is None else like.box_width * scale,
            density=FRACTION * GRAIN_DENSITY,
            gravity=(0.0, -GRAVITY),
            cells=cells,
            frames=frames,
            stride=1,
            length_unit="m",
            time_unit="s",
        )
    )


def shoot(flow: Flow, pairs: int, pixel: float, displacement: float, out: Path, seed: int) -> Film:
    """Films `pairs` pairs, evenly spaced in time, at frames of the simulation.

    Args:
        pixel: m.
        displacement: of the fastest grains in a pair, px; it sets the delay.
    """
    field = VelocityField(flow)
    speed = np.hypot(flow.u, flow.v)
    delay = displacement * pixel / float(np.nanpercentile(speed, FASTEST))
    every = flow.t.size // pairs
    times = flow.t[every - 1 :: every][:pairs].tolist()
    width, height = (float(a[-1]) / pixel + MARGIN for a in (flow.x, flow.y))
    size = {"rows": 8 * math.ceil(height / 8), "columns": 8 * math.ceil(width / 8)}
    camera = Shot(pixel, SEEN, 1 / delay, 0, 2, seed=seed, light=1.0, **size)
    folder = out / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["frame,x,y"]
    for k, t in enumerate(times):
        pair = take_pair(field, t, camera, np.random.default_rng([seed, k]))
        level = grain_level(pair)
        # The PIV measures half a window beyond the grains, or its predictor would be 0 there.
        masks = {"grains": level > 0.5, "mask": smoothed(level, 8.0) > 0.16}
        parts = dict(zip("ab", pair, strict=True))
        parts |= {name: np.where(mask, 255, 0).astype(np.uint8) for name, mask in masks.items()}
        for name, picture in parts.items():
            Image.fromarray(picture).save(folder / f"pair_{k:04d}_{name}.png")
        lines += [f"{k},{x:.3f},{y:.3f}" for x, y in surface_points(level).T]
    (out / "surface.csv").write_text("\n".join(lines) + "\n")
    # I has the density of a grain and the simulation the bulk density: d sqrt(rho_g / rho) agree.
    return Film(flow.grain_diameter * math.sqrt(FRACTION), field, camera, times, delay, folder)


def take_pair(
    field: VelocityField, t: float, camera: Shot, random: np.random.Generator
) -> tuple[Picture, Picture]:
    """Two pictures, half a frame before and after t."""
    grains = seeded(field, t, camera, random)
    # A share of LOST / 2 is missing in each picture.
    fate = random.random(grains.angle.size)
    first, second = (
        exposed([seen.place], seen, camera, random)
        for seen in (
            moved(field, grains.those(kept), t, 0.5 * way / camera.rate, camera)
            for way, kept in ((-1, fate > LOST / 2), (1, fate < 1 - LOST / 2))
        )
    )
    return first, second


def smoothed(image: npt.NDArray[Any], sigma: float) -> Array:
    """Gaussian mean of an image, mirrored at its edges."""
    image = np.asarray(image, np.float64)
    return np.asarray(ndimage.gaussian_filter(image, sigma, mode="reflect", truncate=3))


def grain_level(pair: tuple[Picture, Picture], sigma: float = 4.0) -> Array:
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
