"""The simulated flows of the study: a collapse and a steep, thin chute of every material.

The collapses have another grid and box than the default, the chutes another depth. Both show the
same law, the collapse at small I and the chute up to I of several I0.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.coverage.materials import (
    MU_S,
    NOISE,
    RUNOUT,
    SHALLOW,
    SLOPE,
    Task,
    between,
    make,
)
from granpinn.simulation import Chute, Collapse

I0 = (0.15, 0.5)
DIAMETER = 0.025
ASPECT = (3.0, 8.0)  # of the column
STEEP = (0.6, 0.85)  # I/(I + I0) of the steady flow: (tan slope - mu_s)/(mu_2 - mu_s)
DEPTH = (15.0, 30.0)  # of the layer, grain diameters
CELLS, FRAMES, STRIDE = 512, 50, 4  # of a collapse
LAYER_CELLS, LAYER_FRAMES = 64, 60  # of a chute
PAIRS = 20  # of a seed


def pair(seed: int, number: int) -> tuple[Task, Task]:
    """A collapse and a chute of material `number` of a draw."""
    generator = np.random.default_rng((seed, number))
    mu_s, slope, scale, x = (
        float(generator.uniform(*limits)) for limits in (MU_S, SLOPE, I0, STEEP)
    )
    material: dict[str, Any] = {
        "mu_s": mu_s,
        "mu_2": mu_s + slope,
        "I0": scale,
        "d": DIAMETER,
        "threads": 1,
    }
    aspect = between(generator, *ASPECT)
    run = RUNOUT * min(aspect, SHALLOW ** (1 / 3) * aspect ** (2 / 3))
    height = Collapse().height
    collapse = Collapse(
        **material,
        aspect=aspect,
        box_width=height * (1 + run) / aspect,
        cells=CELLS,
        frames=FRAMES,
        stride=STRIDE,
    )
    depth = DIAMETER * float(generator.uniform(*DEPTH))
    angle = math.atan(mu_s + x * slope)
    # Time in which the flow becomes steady (granpinn/simulation/chute.py).
    time = 2 * scale / (3 * (1 - x) * slope) * depth / DIAMETER
    time *= math.sqrt(depth / math.cos(angle))
    chute = Chute(
        **material,
        height=depth,
        slope=math.degrees(angle),
        cells=LAYER_CELLS,
        frames=LAYER_FRAMES,
        t_end=time,
    )
    law = "mu(I)"
    name = f"{seed}-{number:02d}"
    return Task(f"collapse-{name}", law, collapse), Task(f"chute-{name}", law, chute)


def chutes(count: int, seed: int, noisy: bool) -> list[Task]:
    """The chutes of the pairs of `seed` and the seeds after it, `PAIRS` each; `noisy`: the noise of
    every one is drawn."""
    generator = np.random.default_rng((seed, 3))
    tasks = [pair(seed + n // PAIRS, n % PAIRS)[1] for n in range(count)]
    if not noisy:
        return tasks
    return [dataclasses.replace(task, noise=between(generator, *NOISE)) for task in tasks]


def make_pairs(seed: int, folder: Path) -> list[tuple[Path, Path]]:
    """Simulate the flows that the folder lacks; the paths of all."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        (make(first, folder), make(second, folder))
        for first, second in (pair(seed, number) for number in range(PAIRS))
    ]
