"""The simulated collapse of the experiment and the pictures that an imaginary camera takes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from bench.studies.experiment.particle_images import (
    Array,
    Camera,
    grain_level,
    smoothed,
    surface_points,
    take_pair,
)
from bench.studies.experiment.particle_images import Image as Pixels
from bench.studies.experiment.velocity_field import VelocityField
from granpinn.data import Flow
from granpinn.simulation import Collapse, simulate

HEIGHT = 0.1  # m, of the column; its shape is that of the paper
GRAVITY = 9.81
FRACTION = 0.6  # of the volume: grains
GRAIN_DENSITY = 2500.0
FASTEST = 99.5  # percentile of the speed that makes the largest displacement
MARGIN = 16  # px of dark above and beside the grains


@dataclass(frozen=True, eq=False)
class Film:
    """Pairs of pictures of grains of a diameter: at times[k], `delay` apart, in `folder`."""

    grain: float
    field: VelocityField
    camera: Camera
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
    camera = Camera(pixel, rows=8 * math.ceil(height / 8), columns=8 * math.ceil(width / 8))
    folder = out / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["frame,x,y"]
    for k, t in enumerate(times):
        pair = take_pair(field, t, delay, camera, np.random.default_rng([seed, k]))
        lines += write_pair(folder, k, pair, grain_level(pair))
    (out / "surface.csv").write_text("\n".join(lines) + "\n")
    # I has the density of a grain and the simulation the bulk density: d sqrt(rho_g / rho) agree.
    return Film(flow.grain_diameter * math.sqrt(FRACTION), field, camera, times, delay, folder)


def write_pair(folder: Path, k: int, pair: tuple[Pixels, Pixels], level: Array) -> list[str]:
    """Writes pair k with its masks; its points of the surface, rows of surface.csv.

    Args:
        level: 1 in the grains, 0 outside [rows, columns].
    """
    # The PIV measures half a window beyond the grains, or its predictor would be 0 there.
    masks = {"grains": level > 0.5, "mask": smoothed(level, 8.0) > 0.16}
    parts = dict(zip("ab", pair, strict=True))
    parts |= {name: np.where(mask, 255, 0).astype(np.uint8) for name, mask in masks.items()}
    for name, picture in parts.items():
        Image.fromarray(picture).save(folder / f"pair_{k:04d}_{name}.png")
    return [f"{k},{x:.3f},{y:.3f}" for x, y in surface_points(level).T]
