"""One optimization step on a GPU: granpinn against everything else a PINN user can run.

python -m bench.gpu_step --json gpu_step.json

One process, one GPU, the network 3-250-250-250 in float32: time, launches and memory of a step for
every rival, the measured ceilings of the GPU, errors against float64, ensembles, training. A rival
that fails is a row with its error. --quick leaves out most of the rivals and sizes, ensembles,
training and the trained network; --only chooses parts. --device cpu tries the command on tiny
batches.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import torch

from bench import gpu_accuracy, gpu_table, gpu_training, rivals
from bench.cache import cache_bytes
from bench.device import ceilings, launches
from bench.machine import describe
from bench.processes import run_lines
from bench.rivals import (
    GRANPINN,
    OTHER_RIVALS,
    QUICK_RIVALS,
    Measured,
    Rival,
    Sizes,
)
from granpinn.fit.case import choose_device

JAX_SECONDS = 600.0
PARTS = ("rows", "accuracy", "ensembles", "training")


class Study:
    """The measurements so far, in memory and on disk."""

    def __init__(self, device: torch.device, json_file: Path | None) -> None:
        self.device, self.json_file = device, json_file
        self.begin = time.monotonic()
        self.kept: list[Measured] = []
        self.rows: list[dict[str, Any]] = []
        self.result: dict[str, Any] = {
            "date": time.strftime("%Y-%m-%d"),
            "machine": describe() | gpu(device),
            "rows": self.rows,
        }

    def add(self, name: str, content: Any) -> None:
        """Add a part of the result."""
        self.result[name] = content
        self.result["seconds"] = round(time.monotonic() - self.begin, 1)
        print(f"[{self.result['seconds']:6.1f} s] {name}", flush=True)
        if self.json_file:
            self.json_file.parent.mkdir(parents=True, exist_ok=True)
            self.json_file.write_text(json.dumps(rounded(self.result), indent=1) + "\n")

    def measure(self, some: list[Rival], sizes: Sizes) -> None:
        """All sizes of some rivals."""
        for rival, (form, counts) in itertools.product(some, sizes.items()):
            for points in counts:
                found = rivals.measure(rival, form, points, self.device)
                self.rows.append(found.row)
                if found.advance is not None:
                    self.kept.append(found)
        self.add("rows", self.rows)

    def jax(self, sizes: Sizes) -> None:
        """The rows of bench/gpu_jax.py, which runs in one process for each form."""
        platform = "cuda" if self.device.type == "cuda" else "cpu"
        switches = {"JAX_PLATFORMS": platform, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
        if self.device.type == "cuda":
            torch.cuda.empty_cache()
        for form, counts in sizes.items():
            command = [sys.executable, "-m", "bench.gpu_jax", "--form", form, "--points"]
            command += map(str, counts)
            lines, reason = run_lines(command, os.environ | switches, JAX_SECONDS)
            for about in (line for line in lines if "jax" in line):
                self.result["machine"] |= {"jax": about["jax"]}
            self.rows.extend(line for line in lines if "name" in line)
            done = {line["points"] for line in lines if "name" in line}
            for points in sorted(set(counts) - done):
                row = {"name": "JAX", "form": form, "points": points}
                self.rows.append(row | {"error": f"not measured: {reason or 'no output'}"})
        self.add("rows", self.rows)

    def count_launches(self) -> None:
        """Of the steps that were kept; profiling would have slowed the timings down."""
        for measured in self.kept:
            try:
                measured.row["launches"] = launches(measured.advance or float, measured.steps)
            except Exception as error:
                measured.row["launches_error"] = f"{type(error).__name__}: {error}"


def gpu(device: torch.device) -> dict[str, Any]:
    """The GPU and the versions behind it."""
    if device.type != "cuda":
        return {"gpu": None}
    found = torch.cuda.get_device_properties(device)
    return {
        "gpu": found.name,
        "multiprocessors": found.multi_processor_count,
        "l2_mb": (cache_bytes(device) or 0) / 1e6,
        "gpu_memory_gb": found.total_memory / 1e9,
        "cuda": torch.version.cuda,
    }


def rounded(value: Any) -> Any:
    """A JSON value with its numbers rounded to four significant digits."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return [rounded(item) for item in value] if isinstance(value, list) else value


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few rivals at 512 and 32,768 points")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="parts to measure")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    arguments = parser.parse_args()
    for noise in (DeprecationWarning, UserWarning):  # of torch about the ways of the rivals
        warnings.filterwarnings("ignore", category=noise)
    device, quick = choose_device(arguments.device), arguments.quick
    tiny = device.type == "cpu"
    study = Study(device, arguments.json)
    sizes = rivals.TINY_SIZES if tiny else rivals.QUICK_SIZES if quick else rivals.SIZES
    rows = "rows" in arguments.only
    if "accuracy" in arguments.only:
        trained = 8 if tiny else 0 if quick else 3000
        batch = (32, 8) if tiny else (1024, 128)
        study.add("accuracy", gpu_accuracy.study(device, trained, batch))
    study.add("ceilings", ceilings(device))
    if rows:
        study.measure(GRANPINN, sizes)
        study.measure(QUICK_RIVALS, sizes)
    if not quick and "ensembles" in arguments.only:
        study.add("ensembles", gpu_training.ensemble(device, *((4, 8) if tiny else (32, 512))))
    if not quick and "training" in arguments.only:
        study.add("training", gpu_training.training(device, 16 if tiny else 8000, tiny))
    if rows and not quick:
        study.measure(OTHER_RIVALS, sizes)
        study.jax(sizes)
    study.count_launches()
    l2_mb = study.result["machine"].get("l2_mb")
    gpu_table.complete(study.rows, study.result["ceilings"], l2_mb)
    study.add("rows", study.rows)
    print(json.dumps(study.result["machine"] | study.result["ceilings"]))
    many = [study.result.get(name, []) for name in ("ensembles", "training")]
    texts = [gpu_training.text(*many), gpu_accuracy.text(study.result.get("accuracy", []))]
    print("\n\n".join(text for text in [*texts, gpu_table.text(study.rows)] if text))
    return 0


if __name__ == "__main__":
    sys.exit(main())
