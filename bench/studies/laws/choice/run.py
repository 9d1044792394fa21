"""Are the true laws chosen, and does the band hold the curve?  Flows of five laws, compared.

    python -m bench.studies.laws.choice.run --numbers 0 12 --noise 0 0.02 0.05 --device auto \\
        --flows FLOWS --json choice.json

Simulates collapses of every law (bench/studies/laws/population.py, one core each, all cores), and
identifies them with a free curve and `--compare-laws`, one batch for each noise. Settings that are
not its own go to the identification (`--steps 10000 --network.widths 64,64,64`). A second run with
the same `--flows` keeps the flow files. `--one-by-one` reports the time of a single comparison and
of a single identification.

Defends: the true law is chosen, or not told apart from the chosen one, in 90 % of the flows; the
band holds the whole true curve in 85 to 97 %.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from itertools import product, repeat
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.cores import on_all_cores
from bench.studies.laws.choice.table import table
from bench.studies.laws.population import MATERIALS, make
from granpinn import identify, identify_many
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, FlowFileWarning, read_flow
from granpinn.data.scaling import scales_of
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.decoding import encode
from granpinn.training.progress import Lines
from granpinn.uncertainty import error_model


def made(task: tuple[str, int], folder: Path, cells: int, stride: int, frames: int) -> Path:
    """The file of a law and a number."""
    return make(*task, folder, cells, stride, frames)


def row(law: str, number: int, noise: float, flow: Flow, result: Result) -> dict[str, Any]:
    """What the table needs of one identification, and what a later one may ask."""
    compared = result.checks.get("comparison_of_laws")
    found: dict[str, Any] = {
        "law": law,
        "number": number,
        "noise": noise,
        "truth": None if flow.truth is None else encode(flow.truth),
        "pressure": scales_of(flow).pressure,
        "failure": result.failure,
        "not_done": result.not_done,
        "chosen": compared.chosen if compared else None,
        "comparison": [encode(c) for c in compared.laws] if compared else [],
        "velocity_percent": result.error_percent.velocity,
    }
    curve = result.law.curve
    if curve is None or flow.truth is None:
        return found | {"reason": result.law.reason}
    true = LAWS[law].friction(np.array(curve.I), *flow.truth.theta) + 0 * np.array(curve.I)
    error = np.array(curve.mu) - true
    return found | {
        "I_range": result.law.I_range,
        "mu": curve.mu,
        "low": curve.low,
        "high": curve.high,
        "true": true.tolist(),
        "worst": float(np.abs(error).max()),
        "rms": float(np.sqrt((error**2).mean())),
        "reason": result.law.reason,
    }


def study(
    tasks: Sequence[tuple[str, int]], paths: Sequence[Path], noise: float, config: Config
) -> list[dict[str, Any]]:
    """The rows of all flows at one noise."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FlowFileWarning)
        flows = [read_flow(path) for path in paths]
    # Every flow has a noise of its own.
    seeds = [config.seed + k for k in range(len(flows))]
    results = identify_many(flows, config, seeds, noise=[noise] * len(flows), progress=Lines())
    every = zip(tasks, flows, results, strict=True)
    return [row(*task, noise, flow, result) for task, flow, result in every]


def seconds(path: Path, config: Config) -> dict[str, float]:
    """Time of one identification with the default law, and of one with the comparison."""
    found = {}
    for name, compare in (("identification", False), ("comparison", True)):
        begin = time.monotonic()
        identify(path, dataclasses.replace(config, law="mu_of_i", compare_laws=compare))
        found[name] = round(time.monotonic() - begin, 2)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--laws", nargs="+", choices=list(MATERIALS), default=list(MATERIALS))
    parser.add_argument("--numbers", nargs=2, type=int, default=[0, 12], help="first, end")
    parser.add_argument("--noise", nargs="+", type=float, default=[0.0, 0.02, 0.05])
    parser.add_argument("--cells", type=int, default=256, help="cells across the simulated box")
    parser.add_argument("--stride", type=int, default=2, help="cells between the vectors")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--one-by-one", action="store_true", help="also time single commands")
    parser.add_argument("--flows", type=Path, help="folder that keeps the flow files")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    own, words = parser.parse_known_args()
    try:
        config = raw.config_of(words)
    except ConfigError as error:
        parser.error(str(error))
    config = dataclasses.replace(config, law="free", compare_laws=True)
    assert config.steps is not None
    tasks = list(product(own.laws, range(*own.numbers)))
    found: dict[str, Any] = {
        "cells": own.cells,
        "stride": own.stride,
        "frames": own.frames,
        "settings": words,
        "steps": config.steps,
        "free_curve": error_model.load().free_curve,
        "seconds": {},
        "rows": [],
    }
    with tempfile.TemporaryDirectory() as temporary:
        folder = own.flows or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        sizes = [repeat(value) for value in (folder, own.cells, own.stride, own.frames)]
        paths = on_all_cores(made, tasks, *sizes)
        for noise in own.noise:
            begin = time.monotonic()
            found["rows"] += study(tasks, paths, noise, config)
            found["seconds"][str(noise)] = round(time.monotonic() - begin, 1)
            raw.write(own.json, found)
            print(f"noise {noise:g}: {found['seconds'][str(noise)]} s", flush=True)
        if own.one_by_one:
            found["seconds"] |= seconds(paths[0], config)
            raw.write(own.json, found)
    print(table(found["rows"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
