"""Which rules of the training matter? One is taken out at a time, on flows of known friction.

python -m bench.studies.ablation.run --flows FLOWS --scenes SCENES --out rows.csv --device cuda
python -m bench.studies.ablation.run --table rows.csv

The rows have the error of mu at POINTS inertial numbers of each flow, in %, with the seed, for
every variant of `variants.py`; `--variants NAME ...` trains some. Settings that are not its own go
to every identification. The second command prints the table: the rms error of each group of flows,
and the scatter of the default over its seeds.

Defends: each rule of the training pays on some kind of data.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.ablation.flows import Known, known_flows
from bench.studies.ablation.variants import VARIANTS, Variant
from granpinn.config import Config
from granpinn.fit.case import Case, pose
from granpinn.fit.ensemble import model_of
from granpinn.fit.shear import inertial_range
from granpinn.identification.start import start
from granpinn.training.progress import Lines

COLUMNS = ("variant", "group", "flow", "seed", "rms", "low", "high", "mu_s", "mu_2")


def rows_of(
    name: str, variant: Variant, flows: Sequence[Known], seeds: Sequence[int], config: Config
) -> list[dict[str, Any]]:
    """The rows of one variant: all flows and seeds as one batch."""
    config = dataclasses.replace(config, **variant.settings)
    tasks = [(known, seed) for known in flows for seed in seeds]

    def posed(task: tuple[Known, int]) -> Case:
        known, seed = task
        own = dataclasses.replace(config, seed=seed, I0=known.law["I0"], noise=known.noise)
        return pose(known.flow, own)

    with variant.made():
        with ThreadPoolExecutor(min(16, os.cpu_count() or 1)) as pool:
            cases = list(pool.map(posed, tasks))
        run = start(cases, config, None, Lines(), time.monotonic(), [None] * len(cases))
        run.train()
        rows = []
        for e, ((known, seed), case) in enumerate(zip(tasks, cases, strict=True)):
            mu_s, mu_2, *_ = run.trainer.in_units(e, run.trainer.solution(e)[1].tolist())
            I_range = inertial_range(case.member.data, model_of(case, run.trainer, e)) or (1, 1)
            errors = 100 * known.errors(mu_s, mu_2, I_range)
            found = [np.sqrt(np.mean(errors**2)), errors[0], errors[-1]]
            found += [100 * (mu_s / known.law["mu_s"] - 1), 100 * (mu_2 / known.law["mu_2"] - 1)]
            head = [name, known.group, known.name, seed]
            rows.append(
                dict(zip(COLUMNS, [*head, *(round(float(v), 4) for v in found)], strict=True))
            )
    return rows


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a file of raw results."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rms error of mu in % by variant and group, and that of the default by seed."""
    groups = list(dict.fromkeys(row["group"] for row in rows))
    squares: dict[tuple[str, str], list[float]] = defaultdict(list)
    by_seed: dict[tuple[str, str], list[float]] = defaultdict(list)
    for row in rows:
        squares[row["variant"], row["group"]].append(float(row["rms"]) ** 2)
        if row["variant"] == "default":
            by_seed[str(row["seed"]), row["group"]].append(float(row["rms"]) ** 2)
    lines = [f"{'variant':20s}" + "".join(f"{g.replace('grains: ', ''):>14s}" for g in groups)]
    for name in dict.fromkeys(row["variant"] for row in rows):
        values = [squares.get((name, g)) for g in groups]
        cells = [f"{np.sqrt(np.mean(v)):14.2f}" if v else f"{'-':>14s}" for v in values]
        lines.append(f"{name:20s}{''.join(cells)}")
    for seed in dict.fromkeys(seed for seed, _ in by_seed):
        cells = [
            f"{np.sqrt(np.mean(by_seed[seed, g])):14.2f}" if by_seed[seed, g] else f"{'-':>14s}"
            for g in groups
        ]
        lines.append(f"{'default, seed ' + seed:20s}{''.join(cells)}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--flows", type=Path, help="folder that keeps the simulated flows")
    parser.add_argument("--scenes", type=Path, help="folder with scenes of grains")
    parser.add_argument("--files", type=Path, nargs="+", default=[], help="flows of stated law")
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1])
    parser.add_argument("--groups", nargs="+", help="kinds of data, by default all")
    parser.add_argument("--out", type=Path, help="file for the rows (CSV); rows are added")
    parser.add_argument("--table", type=Path, nargs="+", help="print the table of these rows")
    own, _, config = raw.parse(parser)
    if own.table:
        print(table([row for path in own.table for row in read_rows(path)]))
        return 0
    if own.flows is None or own.out is None:
        parser.error("--flows and --out must be given, or --table")
    own.flows.mkdir(parents=True, exist_ok=True)
    flows = known_flows(own.flows, own.scenes, own.files)
    if own.groups:
        flows = [f for f in flows if f.group in own.groups]
    for name in own.variants:
        begin = time.monotonic()
        rows = rows_of(name, VARIANTS[name], flows, own.seeds, config)
        fresh = not own.out.exists()
        with own.out.open("a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            if fresh:
                writer.writeheader()
            writer.writerows(rows)
        print(f"{name}: {time.monotonic() - begin:.0f} s\n{table(rows)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
