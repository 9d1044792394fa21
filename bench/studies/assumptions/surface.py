"""Do copies that train on with a moved surface line show what whole trainings with it show?

python -m bench.studies.assumptions.surface FLOW.h5 --seeds 0 1 --json surface.json --steps 5000

For every seed one batch trains the line as it is, one standard deviation lower and one higher. Then
it compares three differences of the law between the higher and the lower line: of the whole
trainings, of the copies (granpinn/training/continuation.py), and of the last layer alone. Settings
that are not its own go to the identification as they are.

Defends: the effect of the surface line that a run reports is that of a training with another line.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path
from typing import Any

from bench.studies import raw
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, read_flow
from granpinn.data.surface_sd import spacing
from granpinn.fit import assumptions
from granpinn.fit.case import Case, pose
from granpinn.identification.start import start
from granpinn.training.last_layer import last_layer
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.of_assumptions import effects


def study(flow: Flow, config: Config, seeds: list[int]) -> list[dict[str, Any]]:
    """The laws of all trainings and the three differences, for every seed."""
    first = pose(flow, config)
    assumption = assumptions.surface(first)
    assert assumption is not None
    cases: list[Case] = []
    for seed in seeds:
        for member in (first.member, *assumption.pair()):
            own = dataclasses.replace(member, seed=seed)
            cases.append(dataclasses.replace(first, member=own))
    begin = time.monotonic()
    run = start(cases, config, None, None, begin, [None] * len(cases))
    run.train()
    trained = time.monotonic()
    base = {3 * k: cases[3 * k] for k in range(len(seeds))}
    found = effects(run.trainer, {e: assumptions.assumptions_of(case) for e, case in base.items()})
    seconds = {"train": trained - begin, "copies": time.monotonic() - trained}
    print(f"{len(cases)} trainings, {2 * len(base)} copies: {seconds} s", flush=True)
    names = run.objective.laws[0].names
    rows = []
    for k, seed in enumerate(seeds):
        theta = [run.trainer.solution(3 * k + i)[1].tolist() for i in range(3)]
        derivative = found[3 * k][0].derivative or {}
        alone = _last_layer(run, 3 * k)
        for name, change in derivative.items():
            i = names.index(name)
            rows.append(
                {
                    "seed": seed,
                    "parameter": name,
                    "lower, as it is, higher": [theta[1][i], theta[0][i], theta[2][i]],
                    "whole trainings": theta[2][i] - theta[1][i],
                    "copies": 2 * assumption.sd * change,
                    "last layer": alone[i],
                }
            )
            print(rows[-1], flush=True)
    return rows


def _last_layer(run: TrainingLoop, e: int) -> list[float]:
    """Higher minus lower line, theta [N], after a step of the last layer of member `e` alone."""
    trainer = run.trainer
    found = []
    for place in (e + 1, e + 2):
        member, data = run.objective.members[place], run.objective.data(place)
        problem = dataclasses.replace(member.problem, term_weights=trainer.final_weights(e))
        posed = dataclasses.replace(member, problem=problem, data=data)
        found.append(last_layer(posed, *trainer.trained(e), trainer.step)[1])
    return (found[1] - found[0]).tolist()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flow", type=Path)
    parser.add_argument("--sd", type=float, default=0.5, help="of the line, in spacings")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    own, words = parser.parse_known_args()
    try:
        config = raw.config_of(words)
    except ConfigError as error:
        parser.error(str(error))
    flow = read_flow(own.flow)
    sd = own.sd * spacing(flow)
    flow = dataclasses.replace(flow, attributes={**flow.attributes, "surface_sd": sd})
    head = {"flow": own.flow.name, "sd": sd, "grain diameter": flow.grain_diameter}
    raw.write(own.json, head | {"settings": words, "rows": study(flow, config, own.seeds)})
    return 0


if __name__ == "__main__":
    sys.exit(main())
