"""The flows of the coverage study: materials drawn at random, and controls that break mu(I).

A varied study draws I0, the grain diameter, the column and its sampling as well, a noisy one the
noise of every flow. Controls are a fluid of constant viscosity, cohesive grains, collapses played
backwards; silos of grains (bench/studies/grains) are the others. Those of the simulator had its
scene `Silo`: `git show 531e76e9:granpinn/simulation/silo.py`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.cores import on_all_cores
from granpinn.data import Flow, read_flow
from granpinn.simulation import Collapse, simulate
from granpinn.simulation.scene import Scene

MU_S, SLOPE = (0.2, 0.6), (0.1, 0.3)  # slope: mu_2 - mu_s
VISCOSITY = (0.3, 3.0)  # of the viscous control, log-uniform; 10 sqrt(10) is the unit of the column
COHESION = (0.5, 2.0)  # of the cohesive control; the weight of the column is 10
LAW = "mu(I)"
# Of a varied study; diameters are in widths of the usual column, aspects and diameters log-uniform.
I0, DIAMETER, ASPECT = (0.2, 0.4), (0.0125, 0.05), (3.0, 12.0)
STRIDES, FRAMES = (2, 3, 4), (60, 200)
NOISE = (0.005, 0.3)  # of a noisy study, relative to the largest speed; log-uniform
RUNOUT = 1.64  # widths of the column that grains run per unit of its aspect, at most
SHALLOW = 3.0  # aspect above which the runout grows as its power of 2/3


@dataclasses.dataclass(frozen=True)
class Task:
    """One flow to be made: its law ("mu(I)" or the kind of control) and the scene.

    Attributes:
        noise: that is added to its velocity; None: that of the settings.
    """

    name: str
    law: str
    scene: Scene
    noise: float | None = None


def draw(
    truths: int,
    controls: int,
    seed: int,
    varied: bool = False,
    noisy: bool = False,
    **settings: Any,
) -> list[Task]:
    """The collapses of a study, a function of the arguments; the first truths of two studies of
    one seed are the same.

    Args:
        varied: whether I0, grains, column and sampling of the truths are drawn, too.
        noisy: whether the noise of the truths is.
    """
    generator = np.random.default_rng(seed)
    of_flow, of_noise = (np.random.default_rng((seed, k)) for k in (2, 3))

    def material(generator: np.random.Generator) -> dict[str, Any]:
        mu_s, slope = (float(generator.uniform(*limits)) for limits in (MU_S, SLOPE))
        return {"mu_s": mu_s, "mu_2": mu_s + slope}

    kind = "varied" if varied else "law"
    tasks = []
    for i in range(truths):
        own = settings | (variation(of_flow) if varied else {})
        collapse = Collapse(**material(generator), **own)
        noise = between(of_noise, *NOISE) if noisy else None
        tasks.append(Task(f"{kind}-{seed}-{i:04d}", LAW, collapse, noise))
    generator = np.random.default_rng((seed, 1))
    for i in range(controls):
        eta = float(np.exp(generator.uniform(*np.log(VISCOSITY))))
        changes: dict[str, dict[str, Any]] = {
            "viscous": {"eta_min": eta * (1 - 1e-6), "eta_max": eta},
            "cohesive": {"cohesion": float(generator.uniform(*COHESION))},
            "reversed": {},
        }
        tasks += [
            Task(f"{law}-{seed}-{i:04d}", law, Collapse(**material(generator) | change, **settings))
            for law, change in changes.items()
        ]
    return tasks


def variation(generator: np.random.Generator) -> dict[str, Any]:
    """I0, grains, column and sampling of one collapse of a varied study."""
    aspect = between(generator, *ASPECT)
    run = RUNOUT * min(aspect, SHALLOW ** (1 / 3) * aspect ** (2 / 3))
    height = Collapse().height
    return {
        "I0": float(generator.uniform(*I0)),
        "d": between(generator, *DIAMETER),
        "aspect": aspect,
        "box_width": height * (1 + run) / aspect,
        "stride": int(generator.choice(STRIDES)),
        "frames": int(generator.integers(FRAMES[0], FRAMES[1], endpoint=True)),
    }


def between(generator: np.random.Generator, low: float, high: float) -> float:
    """A value that is uniform in its logarithm."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def path_of(task: Task, folder: Path) -> Path:
    """The file of a task in a folder of flows."""
    return folder / f"{task.name}-{task.scene.cells}-{task.scene.frames}.h5"


def make(task: Task, folder: Path) -> Path:
    """Simulate a task unless an earlier study has left its file; only a whole one has its name."""
    path = path_of(task, folder)
    if not path.exists():
        begun = path.with_suffix(".begun.h5")
        simulate(task.scene, out=begun)
        begun.rename(path)
    return path


def make_all(tasks: Sequence[Task], folder: Path) -> list[Path]:
    """`make` each task, those that are missing on all cores."""
    missing = [task for task in tasks if not path_of(task, folder).exists()]
    if missing:
        on_all_cores(make, missing, repeat(folder, len(missing)))
    return [path_of(task, folder) for task in tasks]


def read(task: Task, path: Path) -> Flow:
    """The flow of a task, as an experiment would give it."""
    flow = as_measured(read_flow(path))
    return backwards(flow) if task.law == "reversed" else flow


def as_measured(flow: Flow) -> Flow:
    """The flow without the pressure and the limits of the viscosity, which no instrument shows."""
    return dataclasses.replace(flow, eta_min=None, eta_max=None, p=None)


def backwards(flow: Flow) -> Flow:
    """The film played backwards: friction then drives the grains."""
    end, surface = flow.t[-1] + flow.t[0], flow.surface
    assert surface is not None
    return dataclasses.replace(
        flow,
        u=-flow.u[::-1],
        v=-flow.v[::-1],
        c=flow.c[::-1],
        surface=dataclasses.replace(surface, t=end - surface.t),
    )
