"""Which link of bench.studies.experiment costs how much of mu_s and mu_2? One batch of trainings.

    python -m bench.studies.experiment.training DIR/links/*.h5 --seeds 0 1 2 --json links.json

Identifies every flow file with every seed, side by side; on a GPU that is a minute. Settings that
are not its own go to the identification (`--steps 32000`). links.py says what the files are.

Defends: what the experiment loses is known link by link, beyond the scatter over seeds.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.experiment.film import TRUTH
from granpinn import identify_many
from granpinn.config import Config
from granpinn.data import read_flow


def study(files: Sequence[Path], config: Config, seeds: Sequence[int]) -> dict[str, Any]:
    """Errors in % of every file and seed, and how well the network follows the velocity."""
    flows = [read_flow(file) for file in files]
    members = [(i, seed) for i in range(len(files)) for seed in seeds]
    results = identify_many([flows[i] for i, _ in members], config, [seed for _, seed in members])
    found: dict[str, Any] = {}
    for (i, _), result in zip(members, results, strict=True):
        row = found.setdefault(files[i].stem, {"mu_s": [], "mu_2": [], "misfit": []})
        for name, true in TRUTH.items():
            row[name].append(100 * (getattr(result.parameters, name).value / true - 1))
        row["misfit"].append(result.error_percent.velocity)
    return found


def table(found: dict[str, Any]) -> str:
    """Mean and standard deviation over the seeds."""
    lines = [f"{'flow':<28}{'mu_s: mean, sd':>18}{'mu_2: mean, sd':>18}{'misfit':>9}  (%)"]
    for name, row in found.items():
        cells = "".join(
            f"{statistics.mean(row[key]):+10.2f} {statistics.pstdev(row[key]):7.2f}"
            for key in TRUTH
        )
        lines.append(f"{name:<28}{cells}{statistics.mean(row['misfit']):9.2f}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", type=Path, nargs="+")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--json", type=Path, help="file for the results")
    arguments, settings, config = raw.parse(parser)
    begin = time.monotonic()
    found = {
        "errors_percent": study(arguments.flows, config, arguments.seeds),
        "command": " ".join(["python -m bench.studies.experiment.training", *sys.argv[1:]]),
        "seeds": arguments.seeds,
        "settings": settings,
        "seconds": round(time.monotonic() - begin, 1),
    }
    raw.write(arguments.json, found)
    print(table(found["errors_percent"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
