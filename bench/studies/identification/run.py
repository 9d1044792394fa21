"""Identification study: every flow file with every seed through the main command, and the errors.

python -m bench.studies.identification.run FLOW.h5 ... --seeds 0 1 2 --json identification.json

Defends: the default recipe finds mu_s to 3 % and mu_2 to 8 % on the collapses with mu_s <= 0.4,
from velocity and surface alone, in ten minutes on two CPU cores, without tuning per case. Settings
that are not its own go to granpinn.train as they are (`--level V0 --noise 0.02`).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from bench.studies import raw

MEASURES = ("mu_s", "mu_2", "velocity", "pressure", "pressure_flowing", "pressure_stagnant")


def run(flow: Path, seed: int, threads: int, settings: list[str], folder: Path) -> dict[str, Any]:
    """One identification in a process of its own: identified values, errors in %, seconds."""
    out = folder / f"{flow.stem}_{seed}"
    command = [sys.executable, "-m", "granpinn.train", str(flow), "--out", str(out)]
    command += ["--seed", str(seed), *settings]
    begin = time.monotonic()
    done = subprocess.run(
        command,
        env=os.environ | {"OMP_NUM_THREADS": str(threads)},
        capture_output=True,
        text=True,
        check=False,
    )
    seconds = time.monotonic() - begin
    row: dict[str, Any] = {"flow": flow.name, "seed": seed, "command_s": round(seconds, 1)}
    if done.returncode:
        return row | {"failed": done.stderr.strip().splitlines()[-1:]}
    result = json.loads((out / "results.json").read_text())
    identified = {name: result["parameters"][name]["value"] for name in ("mu_s", "mu_2")}
    truth = result["truth"] or {}
    signed = {
        f"{name}_signed": 100 * (value / truth[name] - 1)
        for name, value in identified.items()
        if truth.get(name)
    }
    return (
        row
        | identified
        | {
            "error_percent": result["error_percent"] | signed,
            "timing": result["timing"],
            "sha256": result["input"]["sha256"],
        }
    )


def table(rows: list[dict[str, Any]]) -> str:
    """Median over the seeds of each error, the worst one in brackets."""
    lines = [f"{'flow':<28}" + "".join(f"{name:>20}" for name in MEASURES) + f"{'seconds':>10}"]
    for flow in dict.fromkeys(row["flow"] for row in rows):
        mine = [row for row in rows if row["flow"] == flow and "failed" not in row]
        cells = []
        for name in MEASURES:
            errors = [r["error_percent"][name] for r in mine if r["error_percent"].get(name)]
            median = statistics.median(errors) if errors else float("nan")
            worst = max(errors, default=float("nan"))
            cells.append(f"{median:11.2f} ({worst:5.2f}) ")
        seconds = statistics.median([row["command_s"] for row in mine]) if mine else float("nan")
        lines.append(f"{flow:<28}" + "".join(cells) + f"{seconds:10.0f}")
    failed = [row for row in rows if "failed" in row]
    return "\n".join(lines + [f"FAILED {row['flow']} seed {row['seed']}" for row in failed])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", nargs="+", type=Path, help="flow files")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--threads", type=int, default=2, help="threads of one identification")
    parser.add_argument("--jobs", type=int, default=1, help="identifications at a time")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    arguments, settings = parser.parse_known_args()
    cases = [(flow, seed) for seed in arguments.seeds for flow in arguments.flows]
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        jobs = [
            pool.submit(run, flow, seed, arguments.threads, settings, Path(folder))
            for flow, seed in cases
        ]
        for job in jobs:
            rows.append(job.result())
            print(json.dumps(rows[-1]), flush=True)
            how = {"threads": arguments.threads, "jobs": arguments.jobs, "settings": settings}
            raw.write(arguments.json, how | {"rows": rows})
    print(table(rows))
    return any("failed" in row for row in rows)


if __name__ == "__main__":
    sys.exit(main())
