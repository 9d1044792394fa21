"""The floor of the method (gate V-3): exact flows, identified as measured ones.

python -m bench.studies.floor.run --json floor.json --device cuda

Manufactured flows with a source term (fields.py) and the start-up of Bagnold flow (start_up.py) are
sampled on grids (sampling.py) and identified as one batch. One quantity of the sampling changes at
a time. The rows have the errors of mu_s, mu_2 and mu(I). `--cases smooth` takes the cases with this
text in their names, `--seeds 3` repeats each, and `--noises 0.005 0.02` adds white noise to the
velocity of each, relative to its largest speed. All other words are settings of the identification
(`--steps 80000`, `--level V2`): every setting is a batch, and so a call, of its own.

The exact flows have the law at every point. The last-layer step has a mean strain rate where the
law is ill-posed (granpinn/training/equations.py); `--local-law` leaves the mean out.

Defends: mu_s and mu_2 to 0.02 % at the best spacing, 0.1 % for the start-up of Bagnold flow, and
errors in proportion to noise below 2 %.
"""

from __future__ import annotations

import argparse
import math
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from bench.studies import raw
from bench.studies.floor import start_up
from bench.studies.floor.fields import KINDS, THETA, exact
from bench.studies.floor.sampling import Sampling, sample
from granpinn import identify_many
from granpinn.data import Flow, add_noise
from granpinn.physics.laws import mu_of_i
from granpinn.results import Result
from granpinn.training import equations
from granpinn.training.progress import Lines

START_UP = "start-up"
INERTIAL = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)  # I at which mu is compared
SPACINGS, FRAMES, LINES = (16, 32, 64, 128), (10, 20, 80), (0.125, 0.5, 4.0)


@dataclass(frozen=True)
class Case:
    """A flow and its sampling; of the start-up only cells and frames count."""

    flow: str
    sampling: Sampling = field(default_factory=Sampling)

    @property
    def name(self) -> str:
        """The flow and all of its sampling."""
        s = self.sampling
        kind = "" if s.vectors == "point" and s.partial else f" {s.vectors}"
        kind += "" if s.partial else " masked"
        line = "" if s.line == 1 else f" line {s.line:g}"
        return f"{self.flow} {s.cells} cells {s.frames} frames{kind}{line}"

    def made(self) -> Flow:
        """The flow."""
        if self.flow == START_UP:
            return start_up.sample(self.sampling.cells, self.sampling.frames)
        return sample(self.flow, self.sampling)


def cases(surface_pressure: float = 0.0) -> list[Case]:
    """The cases of the note, each once."""
    usual = Sampling(surface_pressure=surface_pressure)
    found = [Case(kind, replace(usual, cells=n)) for kind in KINDS for n in SPACINGS]
    found += [Case("smooth", replace(usual, frames=n)) for n in FRAMES]
    found += [Case("smooth", replace(usual, line=n)) for n in LINES]
    for cells in (32, 64):
        for partial in (True, False):
            of = replace(usual, cells=cells, partial=partial)
            found += [Case("smooth", replace(of, vectors=v)) for v in ("cell", "window")]
    found += [Case("smooth", replace(usual, partial=False))]
    for kind in ("layer", "plug"):
        found += [Case(kind, replace(usual, vectors=v)) for v in ("cell", "window")]
    found += [Case(START_UP, Sampling(cells=n)) for n in SPACINGS[:3]]
    return found


def row(case: Case, noise: float, seed: int, result: Result) -> dict[str, Any]:
    """The errors of one identification."""
    found = {name: p.value for name, p in result.parameters.items()}
    mu = mu_of_i.friction(np.array(INERTIAL), *result.theta)
    truth = mu_of_i.friction(np.array(INERTIAL), *THETA)
    band = result.inertial_number
    return {
        "name": case.name,
        "flow": case.flow,
        "sampling": asdict(case.sampling),
        "noise": noise,
        "seed": seed,
        "n_points": result.data.n_points,
        "I_90": None if band is None else [band.q05, band.q95],
        "found": found,
        "mu_s_percent": 100 * (found["mu_s"] / THETA[0] - 1),
        "mu_2_percent": 100 * (found["mu_2"] / THETA[1] - 1),
        "mu_percent": (100 * (mu / truth - 1)).tolist(),
        "velocity_percent": result.error_percent.velocity,
        "residuals": result.residuals,
        "steps": result.timing.steps,
        "failure": result.failure,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cases", default="", help="text in the names of the cases")
    parser.add_argument("--seeds", type=int, default=1, help="networks for each case")
    parser.add_argument("--noises", type=float, nargs="+", default=[0.0], help="of the velocity")
    parser.add_argument("--surface-pressure", type=float, default=0.0, help="p on the surface")
    parser.add_argument("--local-law", action="store_true", help="no mean strain rate")
    parser.add_argument("--json", type=Path, help="file for the results")
    options, words, config = raw.parse(parser)
    chosen = [case for case in cases(options.surface_pressure) if options.cases in case.name]
    if not chosen:
        names = "\n".join(case.name for case in cases())
        parser.error(f"--cases must be a text in one of these names:\n{names}")
    for kind in {case.flow for case in chosen} & set(KINDS):
        exact(kind, options.surface_pressure)  # made once, before the threads
    with ThreadPoolExecutor() as pool:
        flows = list(pool.map(Case.made, chosen))
    seeds = [config.seed + k for k in range(options.seeds)]
    runs = [
        (case, noise, seed, add_noise(flow, noise, seed))
        for case, flow in zip(chosen, flows, strict=True)
        for noise, seed in product(options.noises, seeds)
    ]
    every, noises, own, data = zip(*runs, strict=True)
    certain = math.inf if options.local_law else equations.CERTAIN  # C / inf: nowhere ill-posed
    with patch.object(equations, "CERTAIN", certain):
        results = identify_many(data, config, own, progress=Lines())
    rows = [row(*found) for found in zip(every, noises, own, results, strict=True)]
    head = {
        "truth": dict(zip(("mu_s", "mu_2", "I0"), THETA, strict=True)),
        "settings": words,
        "surface_pressure": options.surface_pressure,
        "local_law": options.local_law,
        "I": INERTIAL,
    }
    raw.write(options.json, head | {"rows": rows})
    for found in rows:
        errors = (found["mu_s_percent"], found["mu_2_percent"], *found["mu_percent"])
        print(f"{found['name']:44} {found['noise']:5g}", *(f"{value:+8.3f}" for value in errors))
    return 0


if __name__ == "__main__":
    sys.exit(main())
