"""The floor of the method (gate V-3): exact flows, identified as measured ones.

python -m bench.studies.floor.run --json floor.json --device cuda

Manufactured flows with a source term (fields.py) and the start-up of Bagnold flow (start_up.py) are
sampled on grids (sampling.py) and identified as one batch. The rows have the errors of mu_s, mu_2
and mu(I). `--cases smooth` takes the cases with this text in their names, `--seeds 3` repeats each,
and `--noises 0.005 0.02` adds white noise to the velocity of each, relative to its largest speed.
All other words are settings of the identification (`--steps 80000`, `--level V2`).

Defends: mu_s and mu_2 to 0.02 % at the best spacing, 0.1 % for the start-up of Bagnold flow, and
errors in proportion to noise below 2 %.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.studies import raw
from bench.studies.floor import start_up
from bench.studies.floor.fields import KINDS, THETA, exact
from bench.studies.floor.sampling import Sampling, sample
from granpinn import identify_many
from granpinn.data import Flow, add_noise
from granpinn.physics.laws import mu_of_i
from granpinn.progress import Lines
from granpinn.results import Result

START_UP = "start-up"
INERTIAL = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)  # I at which mu is compared
SPACINGS, FRAMES = (16, 32, 64, 128), (10, 20, 80)


class Case(NamedTuple):
    """A flow and its sampling."""

    flow: str
    sampling: Sampling

    @property
    def name(self) -> str:
        return f"{self.flow} {self.sampling.cells} cells {self.sampling.frames} frames"

    def made(self) -> Flow:
        """The flow."""
        if self.flow == START_UP:
            return start_up.sample(*self.sampling)
        return sample(self.flow, self.sampling)


CASES = [Case(kind, Sampling(cells=n)) for kind in KINDS for n in SPACINGS]
CASES += [Case("smooth", Sampling(frames=n)) for n in FRAMES]
CASES += [Case(START_UP, Sampling(cells=n)) for n in SPACINGS[:3]]


def row(case: Case, noise: float, seed: int, result: Result) -> dict[str, Any]:
    """The errors of one identification."""
    found = {name: p.value for name, p in result.parameters.items()}
    mu = mu_of_i.friction(np.array(INERTIAL), *result.theta)
    truth = mu_of_i.friction(np.array(INERTIAL), *THETA)
    return {
        "name": case.name,
        "flow": case.flow,
        "sampling": case.sampling._asdict(),
        "noise": noise,
        "seed": seed,
        "n_points": result.data.n_points,
        "I_90": result.law.I_range,
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
    parser.add_argument("--json", type=Path, help="file for the results")
    options, words, config = raw.parse(parser)
    chosen = [case for case in CASES if options.cases in case.name]
    if not chosen:
        names = "\n".join(case.name for case in CASES)
        parser.error(f"--cases must be a text in one of these names:\n{names}")
    for kind in {case.flow for case in chosen} & set(KINDS):
        exact(kind)  # made once, before the threads
    with ThreadPoolExecutor() as pool:
        flows = list(pool.map(Case.made, chosen))
    seeds = [config.seed + k for k in range(options.seeds)]
    runs = [
        (case, noise, seed, add_noise(flow, noise, seed))
        for case, flow in zip(chosen, flows, strict=True)
        for noise, seed in product(options.noises, seeds)
    ]
    every, noises, own, data = zip(*runs, strict=True)
    results = identify_many(data, config, own, progress=Lines())
    rows = [row(*found) for found in zip(every, noises, own, results, strict=True)]
    head = {
        "truth": dict(zip(("mu_s", "mu_2", "I0"), THETA, strict=True)),
        "settings": words,
        "I": INERTIAL,
    }
    raw.write(options.json, head | {"rows": rows})
    for found in rows:
        errors = (found["mu_s_percent"], found["mu_2_percent"], *found["mu_percent"])
        print(f"{found['name']:44} {found['noise']:5g}", *(f"{value:+8.3f}" for value in errors))
    return 0


if __name__ == "__main__":
    sys.exit(main())
