"""The flows of the ablation: each group is one kind of data that a rule may matter for.

Groups: `clean` collapses of every shape on 256 cells, the same with noise of 2 and 20 % of the
largest speed, `fine` collapses on 512 cells, `few` vectors (every second column and row, every
fourth frame), `floor` flows that solve the equations exactly, one group for each scene of
grains, and flow files that state their law, with the same noises.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.studies.coverage.materials import Task, as_measured, draw, make_all, read
from bench.studies.floor.fields import THETA
from bench.studies.floor.run import Case
from bench.studies.floor.sampling import Sampling
from bench.studies.grains.law import mu_of_i
from bench.studies.grains.make import FLOW, SUMMARY
from granpinn.arrays import Float64
from granpinn.data import Flow, read_flow

DRAW, COLLAPSES, FINE = 9, 8, 4  # seed of the materials, and how many of them
NOISES = {"clean": 0.0, "noise 2 %": 0.02, "noise 20 %": 0.2}
EXACT = (
    Case("smooth", Sampling(cells=32)),
    Case("plug", Sampling(cells=64)),
    Case("start-up", Sampling(cells=32)),
)
POINTS = 9  # inertial numbers at which mu is compared


class Known(NamedTuple):
    """A flow of known friction.

    Attributes:
        group, name: the kind of data, and the flow.
        noise: added to the velocity, relative to the largest speed.
        law: mu_s, mu_2 and I0.
        I: inertial numbers at which mu is compared [n]; None: over the range that the fit finds.
    """

    group: str
    name: str
    flow: Flow
    noise: float
    law: dict[str, float]
    I: Float64 | None = None

    def errors(self, mu_s: float, mu_2: float, I_range: tuple[float, float]) -> Float64:
        """Relative errors of mu at the inertial numbers [n]."""
        low, high = I_range
        at = np.geomspace(low, high, POINTS) if self.I is None else self.I
        found = {"mu_s": mu_s, "mu_2": mu_2, "I0": self.law["I0"]}
        return np.asarray(mu_of_i(found, at) / mu_of_i(self.law, at) - 1)


def known_flows(folder: Path, scenes: Path | None, files: Sequence[Path] = ()) -> list[Known]:
    """All flows; collapses that `folder` lacks are simulated there on all cores.

    Args:
        scenes: folder of bench.studies.grains.make; None: no grains.
        files: flow files that state the law of the material.
    """
    usual = draw(COLLAPSES, 0, DRAW, True, cells=256, stride=2, frames=200, threads=1)
    fine = draw(FINE, 0, DRAW, True, cells=512, stride=2, frames=200, threads=1)
    paths = make_all([*fine, *usual], folder)
    flows = [_collapse(t, p) for t, p in zip([*fine, *usual], paths, strict=True)]
    known = [k._replace(group="fine") for k in flows[:FINE]]
    for group, noise in NOISES.items():
        known += [k._replace(group=group, noise=noise) for k in flows[FINE:]]
    known += [_few(k) for k in flows[FINE:]][:4]
    theta = dict(zip(("mu_s", "mu_2", "I0"), THETA, strict=True))
    known += [Known("floor", case.name, case.made(), 0.0, theta) for case in EXACT]
    known += list(_grains(scenes)) if scenes else []
    return known + [k for path in files for k in known_file(path)]


def known_file(path: Path) -> Iterator[Known]:
    """A flow file that states its law, as an experiment would give it, with each noise.

    Raises:
        ValueError: it states none.
    """
    flow = as_measured(read_flow(path))
    if flow.truth is None:
        raise ValueError(f"{path} must state the law of the material, got none (true_mu_s, ...)")
    truth = flow.truth
    law = {"mu_s": truth.mu_s, "mu_2": truth.mu_2, "I0": truth.I0}
    for group, noise in NOISES.items():
        yield Known(f"{group} (file)", path.stem, flow, noise, law)


def _collapse(task: Task, path: Path) -> Known:
    c = task.scene
    law = {"mu_s": c.mu_s, "mu_2": c.mu_2, "I0": c.I0}
    return Known("clean", task.name, read(task, path), 0.0, law)


def _few(known: Known) -> Known:
    """Every second column and row and every fourth frame of a flow."""
    flow, space, time = known.flow, slice(None, None, 2), slice(None, None, 4)
    cut = {name: getattr(flow, name)[time, space, space] for name in ("u", "v", "c")}
    cut |= {"t": flow.t[time], "y": flow.y[space], "x": flow.x[space]}
    assert flow.surface is not None
    kept = np.isin(flow.surface.t, cut["t"])
    line = flow.surface
    surface = dataclasses.replace(line, t=line.t[kept], x=line.x[kept], y=line.y[kept])
    return known._replace(group="few", flow=dataclasses.replace(flow, surface=surface, **cut))


def _grains(scenes: Path) -> Iterator[Known]:
    for path in sorted(scenes.glob(f"*/{FLOW}")):
        summary = json.loads(path.with_name(SUMMARY).read_text())
        own = summary["own"]["along_D"]
        law = own["law"] or {"mu_s": own["mean"]["mu"], "mu_2": own["mean"]["mu"], "I0": 0.3}
        low, high = own["I_range"]
        at = np.geomspace(low, high, POINTS) if own["law"] else np.array([own["mean"]["I"]])
        yield Known(f"grains: {summary['scene']}", path.parent.name, read_flow(path), 0.0, law, at)
