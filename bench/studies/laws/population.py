"""Collapses of every friction law, with material, grains and aspect ratio drawn at random.

A collapse is a function of (law, number). The ranges are those of dense grains; all parameters of
a law that a material can change are drawn.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.data import Flow, write_flow
from granpinn.simulation import Collapse, simulate

ASPECT = (1.5, 5.0)  # log-uniform
GRAINS = (50.0, 100.0)  # of the height, log-uniform
HEIGHT = 10.0
DURATION = 3.0  # in sqrt(height / g)
COHESION = (0.005, 0.03)  # of density x gravity x height, log-uniform
Limits = tuple[float, float]

# Parameters by name; "rise" is mu_2 - mu_s. Those that are not named keep their usual value.
MATERIALS: dict[str, dict[str, Limits]] = {
    "coulomb": {"mu_s": (0.25, 0.55)},
    "mu_of_i": {"mu_s": (0.25, 0.5), "rise": (0.1, 0.3), "I0": (0.2, 0.45)},
    "regularised": {"mu_s": (0.25, 0.5), "rise": (0.1, 0.3), "I0": (0.2, 0.45)},
    "power": {"mu_s": (0.25, 0.5), "b": (0.2, 0.8)},
    "cohesive": {"mu_s": (0.25, 0.5), "rise": (0.1, 0.3), "I0": (0.2, 0.45)},
}


def log_uniform(draw: np.random.Generator, limits: Limits) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(draw.uniform(*np.log(limits))))


def scene(law: str, number: int, cells: int, stride: int, frames: int) -> Collapse:
    """The collapse of a law and a number."""
    draw = np.random.default_rng((23, list(MATERIALS).index(law), number))
    values = {name: float(draw.uniform(*limits)) for name, limits in MATERIALS[law].items()}
    if "rise" in values:
        values["mu_2"] = values["mu_s"] + values.pop("rise")
    if law == "cohesive":
        values["c"] = HEIGHT * log_uniform(draw, COHESION)
    return column(draw, cells, stride, frames, law=law, **values)


def column(
    draw: np.random.Generator, cells: int, stride: int, frames: int, **material: Any
) -> Collapse:
    """A collapse with the aspect ratio and the grains of the next two draws."""
    aspect, grains = log_uniform(draw, ASPECT), log_uniform(draw, GRAINS)
    return Collapse(
        **material,
        aspect=aspect,
        d=HEIGHT / grains,
        height=HEIGHT,
        box_width=HEIGHT * (1.4 + 1.5 / aspect),
        box_height=1.1 * HEIGHT,
        t_end=DURATION * HEIGHT**0.5,
        cells=cells,
        stride=stride,
        frames=frames,
        threads=1,
    )


def make(law: str, number: int, folder: Path, cells: int, stride: int, frames: int) -> Path:
    """The file of a flow; an earlier one is kept."""
    path = folder / f"{law}-{number:03d}-{cells}-{stride}-{frames}.h5"
    if not path.exists():
        write_flow(measured(simulate(scene(law, number, cells, stride, frames))), path)
    return path


def measured(flow: Flow) -> Flow:
    """The flow as an experiment gives it, with the true law."""
    return dataclasses.replace(flow, eta_min=None, eta_max=None, p=None)
