"""Accuracy of the fused kernels over the table of random configurations (gate K-1).

Claim: against the float64 oracle, the error of every fused output is at most twice the error of
plain float32 autograd, and of every gradient three times, in each of 500 configurations.

    python -m bench.kernel_accuracy --rows 500 --json bench/results/kernel_accuracy.json
    python -m bench.kernel_accuracy --only 68 --device cuda

With --only, all comparisons of those rows are printed. An exact result of zeros proves nothing and
counts as a failure, except in the gradient of theta.
"""

from __future__ import annotations

import argparse
import datetime
import json
import multiprocessing
import statistics
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from bench.machine import describe
from tests.kernels.accuracy import Comparison, compare, is_void
from tests.kernels.configurations import configuration
from tests.kernels.devices import OnDevice


def measure(
    rows: list[int], jobs: int, device: str, every: bool
) -> tuple[dict[str, list[Comparison]], list[str]]:
    """Comparisons by output over rows of the table, and the failures in words."""
    by_output: dict[str, list[Comparison]] = {}
    failures = []
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        found = pool.map(partial(_compare, device=device), rows)
        for done, (index, comparisons) in enumerate(zip(rows, found, strict=True), 1):
            if every:
                print(configuration(index), device)
            for comparison in comparisons:
                by_output.setdefault(comparison.name, []).append(comparison)
                failed = not comparison.passed or is_void(comparison)
                if every:
                    print(line(comparison), "FAILED" if failed else "")
                if failed:
                    failures.append(f"{configuration(index)}: {comparison}")
                    print("failed:", failures[-1], flush=True)
            if done % 50 == 0:
                print(f"{done} of {len(rows)} configurations", flush=True)
    return by_output, failures


def _compare(index: int, device: str) -> list[Comparison]:
    from granpinn.kernels import ops

    return compare(configuration(index), ops if device == "cpu" else OnDevice(ops, device))


def line(c: Comparison) -> str:
    return (
        f"  {c.name:<14} error {c.kernel_error:.2e}, of autograd {c.autograd_error:.2e}, "
        f"ratio {c.ratio:.2f} of {c.factor:.0f}, norm {c.norm:.2e}"
    )


def summary(comparisons: list[Comparison]) -> dict[str, float]:
    """One output: ratios to the yardstick and to autograd's error alone, worst cosine, bias."""
    told = [c for c in comparisons if c.norm > 0]
    ratios = [c.ratio for c in told]
    alone = [c.kernel_error / c.autograd_error for c in told if c.autograd_error > 0]
    return {
        "allowed ratio": told[0].factor,
        "median ratio": round(statistics.median(ratios), 3),
        "worst ratio": round(max(ratios), 3),
        "median error over autograd error": round(statistics.median(alone or [0.0]), 3),
        "median error": float(f"{statistics.median(c.kernel_error for c in told):.3g}"),
        "worst 1 - cosine": float(f"{max(1 - c.cosine for c in told):.3g}"),
        "median signed bias": float(f"{statistics.median(c.bias for c in told):.3g}"),
        "configurations": len(told),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--only", type=int, nargs="+", metavar="INDEX", help="these rows, in full")
    parser.add_argument("--device", choices=["cpu", "cuda"], default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, help="where to keep the result")
    arguments = parser.parse_args()
    rows = arguments.only or list(range(arguments.rows))
    by_output, failures = measure(rows, arguments.jobs, arguments.device, bool(arguments.only))
    result: dict[str, Any] = {
        "machine_info": describe(),
        "datetime": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": " ".join(["python -m bench.kernel_accuracy", *sys.argv[1:]]),
        "device": arguments.device,
        "configurations": len(rows),
        "failures": failures,
        "outputs": {
            name: summary(comparisons)
            for name, comparisons in by_output.items()
            if any(c.norm > 0 for c in comparisons)
        },
    }
    for name, told in result["outputs"].items():
        print(f"{name:>14}: median {told['median ratio']:.2f}, worst {told['worst ratio']:.2f}")
    print(f"{len(failures)} failures in {len(rows)} configurations")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return int(bool(failures))


if __name__ == "__main__":
    raise SystemExit(main())
