"""One optimization step on a GPU: granpinn against everything else a PINN user can run.

python -m bench.gpu_step --json gpu_step.json

One process, one GPU, the network 3-250-250-250 in float32: time and memory of a step for
every rival, the error of the fast mode, an ensemble. A rival that fails is a row with its error.
--quick leaves out JAX and some sizes; --only chooses parts. --device cpu tries tiny batches.

Goals: ms of a step in the strong form on an H200, see GOALS; the mixed form has 0.6 of it.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import warnings
from pathlib import Path
from typing import Any

import pandas as pd
import torch

from bench import gpu_accuracy, gpu_training, rivals
from bench.processes import run_lines
from bench.rivals import GRANPINN, OTHERS, OURS, Sizes
from bench.studies import raw
from granpinn.kernels.builds import choose_device

JAX_SECONDS = 600.0
PARTS = ("rows", "accuracy", "ensembles")
GOALS = {
    OURS["fp32"]: {512: 0.08, 32768: 4.3, 262144: 34.0},
    OURS["fast"]: {512: 0.05, 32768: 1.8, 262144: 13.0},
}
MIXED = 0.6
COLUMNS = ["name", "form", "points", "ms", "peak_gb"]
COLUMNS += ["best_rival", "times_faster", "goal_ms", "error"]
Row = dict[str, Any]


def jax_rows(sizes: Sizes, device: torch.device) -> list[Row]:
    """The rows of bench/gpu_jax.py, which runs in one process for each form."""
    platform = "cuda" if device.type == "cuda" else "cpu"
    switches = {"JAX_PLATFORMS": platform, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    if device.type == "cuda":
        torch.cuda.empty_cache()
    rows: list[Row] = []
    for form, counts in sizes.items():
        command = [sys.executable, "-m", "bench.gpu_jax", "--form", form, "--points"]
        lines, reason = run_lines([*command, *map(str, counts)], os.environ | switches, JAX_SECONDS)
        missing = set(counts) - {line["points"] for line in lines}
        error = f"not measured: {reason or 'no output'}"
        lines += [{"name": "JAX", "form": form, "points": n, "error": error} for n in missing]
        rows += lines
    return rows


def gpu(device: torch.device) -> dict[str, Any]:
    """The GPU and the versions behind it."""
    if device.type != "cuda":
        return {"gpu": None}
    found = torch.cuda.get_device_properties(device)
    return {"gpu": found.name, "cuda": torch.version.cuda}


def complete(rows: list[Row]) -> None:
    """Adds the goal and the ratio to the best rival to every row of granpinn."""
    for row in rows:
        if row["name"] not in OURS.values() or "ms" not in row:
            continue
        others = [
            other
            for other in rows
            if (other["form"], other["points"]) == (row["form"], row["points"])
            and "ms" in other
            and other["name"] not in OURS.values()
        ]
        if others:
            best = min(others, key=lambda other: float(other["ms"]))
            row |= {"best_rival": best["name"], "times_faster": best["ms"] / row["ms"]}
        if goal := GOALS[row["name"]].get(row["points"]):
            row["goal_ms"] = goal if row["form"] == "strong" else MIXED * goal


def text(rows: list[Row]) -> str:
    """A line for every row."""
    table = pd.DataFrame(rows).reindex(columns=COLUMNS)
    return str(table.to_string(index=False, na_rep="-", float_format="{:.3g}".format))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="512 and 32,768 points, no JAX")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="parts to measure")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    own = parser.parse_args()
    for noise in (DeprecationWarning, UserWarning):  # of torch about the ways of the rivals
        warnings.filterwarnings("ignore", category=noise)
    device = choose_device(own.device)
    tiny = device.type == "cpu"
    result: dict[str, Any] = {"gpu": gpu(device)}

    def add(name: str, content: Any) -> None:
        result[name] = content
        raw.write(own.json, result)

    if "accuracy" in own.only:
        steps, batch = (8, (32, 8)) if tiny else (3000, (1024, 128))
        add("accuracy", gpu_accuracy.study(device, steps, batch))
        print("\n".join(map(str, result["accuracy"])))
    if "ensembles" in own.only:
        add("ensembles", gpu_training.ensemble(device, *((4, 8) if tiny else (32, 512))))
        print("\n".join(map(str, result["ensembles"])))
    if "rows" in own.only:
        sizes = rivals.TINY_SIZES if tiny else rivals.QUICK_SIZES if own.quick else rivals.SIZES
        rows = [
            rivals.measure(rival, form, points, device)
            for rival, (form, counts) in itertools.product([*GRANPINN, *OTHERS], sizes.items())
            for points in counts
        ]
        rows += [] if own.quick else jax_rows(sizes, device)
        complete(rows)
        add("rows", rows)
        print(text(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
