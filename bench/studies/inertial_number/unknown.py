"""Error bars where I0 is not known: collapses of random I0, identified with an assumed one.

python -m bench.studies.inertial_number.unknown --truths 20 --draw 15 --json unknown.json

The flows are those of `coverage.run --varied`: their I0 is 0.2 to 0.4. Each is identified with
I0 = 0.3, and its profile is made as by --free-I0. The rows have the truth and what the profile says
of mu_s, the slope (mu_2 - mu_s)/I0 and I0. Settings that are not its own go to the identification.
Defends: the 90 % intervals of mu_s, slope and I0 hold 85 to 95 % of the truths.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.coverage.fit import sharpness
from bench.studies.coverage.materials import Task, draw, make_all, read
from granpinn import identify_many
from granpinn.checks.profile_of_I0 import grid_of, profile_from, settings_of
from granpinn.config import Config, ConfigError
from granpinn.results import Result
from granpinn.results.decoding import encode
from granpinn.training.progress import Lines
from granpinn.uncertainty.unknown_I0 import unknown_I0

ASSUMED = 0.3


def study(tasks: Sequence[Task], config: Config, folder: Path) -> list[dict[str, Any]]:
    """A row for each flow; all runs are one batch, and all profiles another."""
    flows = list(map(read, tasks, make_all(tasks, folder)))
    config = dataclasses.replace(config, I0=ASSUMED, members=1)
    seeds = range(config.seed, config.seed + len(flows))
    runs = identify_many(flows, config, list(seeds), keep_fields=False, progress=Lines())
    grid, each = grid_of(config), range(config.profile.seeds)
    many = [(flow, I0, seed) for flow in flows for I0 in grid for seed in each]
    trained = identify_many(
        [flow for flow, _, _ in many],
        settings_of(config),
        [seed for _, _, seed in many],
        I0=[I0 for _, I0, _ in many],
        keep_fields=False,
        progress=Lines(),
    )
    size = len(grid) * len(each)
    parts = [trained[k * size : (k + 1) * size] for k in range(len(flows))]
    return list(map(row, tasks, runs, parts, repeat(config.profile.law_accuracy)))


def row(task: Task, run: Result, trained: Sequence[Result], law_accuracy: float) -> dict[str, Any]:
    """The truth of one flow and its profile with error bars."""
    c = task.scene
    truth = {"mu_s": c.mu_s, "slope": (c.mu_2 - c.mu_s) / c.I0, "I0": c.I0}
    profile = profile_from(trained, law_accuracy, ASSUMED)
    known = unknown_I0(profile.points, profile.best, profile.allowed, run)
    profile = dataclasses.replace(profile, unknown=known)
    return {"name": task.name, "truth": truth, "mu_2": c.mu_2, "profile": encode(profile)}


def text(rows: Sequence[dict[str, Any]]) -> str:
    """Coverage and sharpness of mu_s and the slope; for I0 how often it has an interval."""
    known = [row for row in rows if row["profile"]["unknown"] is not None]
    lines = [f"{len(rows)} flows, {len(known)} with error bars"]
    for name in ("mu_s", "slope") if known else ():
        truth = np.array([row["truth"][name] for row in known])
        found = [row["profile"]["unknown"][name] for row in known]
        ends = np.array([p["interval_90"] for p in found])
        missed = np.maximum(np.maximum(ends[:, 0] - truth, truth - ends[:, 1]), 0.0) / truth
        error = np.array([p["value"] for p in found]) / truth - 1
        half = (ends[:, 1] - ends[:, 0]) / 2 / truth
        lines.append(
            f"{name}: rms error {100 * np.sqrt(np.mean(error**2)):.2f} %, half-width "
            f"{100 * np.median(half):.2f} %, holds {100 * np.mean(missed == 0):.0f} %, score "
            f"{sharpness(error, half, missed):.2f}"
        )
    status = [row["profile"]["status"] for row in rows]
    counts = ", ".join(f"{status.count(s)} {s}" for s in sorted(set(status)))
    right = sum(_allowed(row) for row in rows)
    return "\n".join([*lines, f"I0: {counts}; the truth is allowed in {right} of {len(rows)}"])


def _allowed(row: dict[str, Any]) -> bool:
    low, high = row["profile"]["allowed"]
    return bool((low or 0.0) <= row["truth"]["I0"] <= (high or np.inf))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--truths", type=int, default=20, help="number of materials")
    parser.add_argument("--draw", type=int, default=15, help="seed of the materials")
    parser.add_argument("--cells", type=int, default=256, help="cells across the simulated box")
    parser.add_argument("--flows", type=Path, help="folder that keeps the flow files")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    own, words = parser.parse_known_args()
    try:
        config = raw.config_of(words, {})
    except ConfigError as error:
        parser.error(str(error))
    tasks = draw(own.truths, 0, own.draw, varied=True, cells=own.cells, threads=1)
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        folder = own.flows or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        rows = study(tasks, config, folder)
    seconds = round(time.monotonic() - begin, 1)
    raw.write(own.json, {"draw": own.draw, "settings": words, "seconds": seconds, "rows": rows})
    print(text(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
