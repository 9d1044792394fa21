"""Coverage study of the error bars: known materials, drawn at random, simulated and identified.

python -m bench.studies.coverage.run --truths 100 --members 2 --flows flows --json coverage.json

It draws mu_s in 0.2 to 0.6 and mu_2 - mu_s in 0.1 to 0.3, simulates each collapse (one core each,
all cores), identifies all of them as one batch and writes values and residuals of every member.
table.py puts them into one table, to which fit.py fits the error model. Settings that are not its
own go to the identification as they are (`--steps 20000 --noise 0.2`).

Controls are flows that do not obey mu(I), or that walls carry. No result of one may be good.
Defends: the 90 % intervals of the default recipe hold 85 to 95 % of the truths.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

from bench.studies import raw
from bench.studies.cores import processes
from bench.studies.coverage.materials import Task, draw, make_all, read
from bench.studies.one_law.flows import chutes
from bench.studies.records import balance_of, records_of
from granpinn.config import Config
from granpinn.fit import ensemble
from granpinn.fit.case import Case, members, pose
from granpinn.fit.ensemble import network_of
from granpinn.identification.start import start
from granpinn.kernels.builds import choose_device
from granpinn.progress import Lines
from granpinn.training.loop import TrainingLoop

FEW = 6  # flows whose momentum balances this process makes


def row(task: Task, cases: Sequence[Case], run: TrainingLoop, first: int) -> dict[str, Any]:
    """The records of one identification: the members of `run` from `first` on."""
    c = task.scene
    found, shown = ensemble.members_of(cases, run, first)
    case, e = cases[shown], first + shown
    result = ensemble.result(case, run, e, found, network_of(case, run.trainer, e))
    names = ("I0", "d", "aspect", "stride", "frames")
    return {
        "name": task.name,
        "law": task.law,
        "truth": {"mu_s": c.mu_s, "mu_2": c.mu_2},
        "flow": {name: getattr(c, name, None) for name in names},
        "n_points": len(case.member.data.points),
        **records_of(result),
        "failure": result.failure
        or (None if result.residuals else "residuals that are not finite"),
    }


def settings_of(task: Task, config: Config, i: int) -> Config:
    """The settings of the identification of task i of a batch."""
    noise = config.noise if task.noise is None else task.noise
    return dataclasses.replace(config, seed=config.seed + i, I0=task.scene.I0, noise=noise)


def balanced(task: Task, path: Path, config: Config) -> dict[str, Any] | None:
    """The momentum balance of a flow, as its identification sees it."""
    return balance_of(pose(read(task, path), config).balance(config.I0))


def identified(
    tasks: Sequence[Task], paths: Sequence[Path], config: Config
) -> list[dict[str, Any]]:
    """The rows of these flows, identified as one batch; the first has the seed of the settings.

    Fields, figures and pressures, which `granpinn.identify_many` would add, are not made. The
    momentum balances, which need no network, are made on the other cores meanwhile.
    """
    settings = [settings_of(task, config, i) for i, task in enumerate(tasks)]

    def posed(i: int) -> list[Case]:
        return list(members(pose(read(tasks[i], paths[i]), settings[i])))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cases = list(pool.map(posed, range(len(tasks))))
    every = [case for own in cases for case in own]
    run = start(
        every,
        config,
        None,
        Lines(),
        time.monotonic(),
        choose_device(config.device),
        [None] * len(every),
    )
    with processes(spare=1) if len(tasks) > FEW else nullcontext() as others:
        # Lazily, after the training, where no processes are worth their start.
        balances = (others.map if others else map)(balanced, tasks, paths, settings)
        run.train()
        firsts = range(0, len(every), config.members)
        rows = list(map(row, tasks, cases, repeat(run), firsts))
        pairs = zip(rows, balances, strict=True)
        return [own | {"baseline": balance} for own, balance in pairs]


class Options(NamedTuple):
    """What the words of a command ask for: the options of the study, and the identification's."""

    own: argparse.Namespace
    words: list[str]
    config: Config

    @property
    def grid(self) -> dict[str, int]:
        """Settings of every simulation."""
        own = self.own
        return {"cells": own.cells, "stride": own.stride, "frames": own.frames, "threads": 1}

    @property
    def tasks(self) -> list[Task]:
        """The flows."""
        own = self.own
        if own.chutes:
            return chutes(own.truths, own.draw, own.noisy)
        return draw(own.truths, own.controls, own.draw, own.varied, own.noisy, **self.grid)


def options(arguments: Sequence[str] | None = None) -> Options:
    """The options in the words of a command line; None: those of this process."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--truths", type=int, default=100, help="number of materials")
    parser.add_argument("--controls", type=int, default=4, help="flows of each of the other laws")
    parser.add_argument("--cells", type=int, default=256, help="cells across the simulated box")
    parser.add_argument("--stride", type=int, default=2, help="cells between the vectors")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--varied", action="store_true", help="I0, grains, column, sampling too")
    parser.add_argument("--noisy", action="store_true", help="the noise of every flow too")
    parser.add_argument("--chutes", action="store_true", help="steep chutes, no collapses")
    parser.add_argument("--draw", type=int, default=0, help="seed of the materials")
    parser.add_argument("--flows", type=Path, required=True, help="folder that keeps the flows")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    return Options(*raw.parse(parser, arguments))


def main(arguments: Sequence[str] | None = None) -> int:
    own, words, config = asked = options(arguments)
    own.flows.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    paths = make_all(asked.tasks, own.flows)
    print(f"{len(paths)} flows in {time.monotonic() - begin:.0f} s", flush=True)
    rows = identified(asked.tasks, paths, config)
    names = ("draw", "varied", "noisy", "chutes")
    head = {name: getattr(own, name) for name in names} | {"simulation": asked.grid}
    raw.write(own.json, head | {"settings": words, "steps": config.steps, "rows": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
