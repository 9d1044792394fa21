"""Accuracy of the fused kernels over the table of random configurations (gate K-1).

Claim: the error of every fused output against the float64 oracle is at most twice that of plain
float32 autograd, of every gradient three times, in each of 500 configurations.

    python -m bench.kernel_accuracy --rows 500 --json bench/results/kernel_accuracy.json
"""

from __future__ import annotations

import argparse
import datetime
import json
import multiprocessing
import statistics
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from bench.machine import describe
from tests.kernels.accuracy import Comparison, compare
from tests.kernels.configurations import configuration


def measure(rows: int, jobs: int) -> tuple[dict[str, list[Comparison]], list[str]]:
    """Comparisons by output over the first rows of the table, and the failures in words."""
    by_output: dict[str, list[Comparison]] = {}
    failures = []
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        for index, comparisons in enumerate(pool.map(_compare, range(rows))):
            for comparison in comparisons:
                by_output.setdefault(comparison.name, []).append(comparison)
                if not comparison.passed:
                    failures.append(f"{configuration(index)}: {comparison}")
                    print("failed:", failures[-1], flush=True)
            if (index + 1) % 50 == 0:
                print(f"{index + 1} of {rows} configurations", flush=True)
    return by_output, failures


def _compare(index: int) -> list[Comparison]:
    from granpinn import ops

    return compare(configuration(index), ops)


def summary(comparisons: list[Comparison]) -> dict[str, float]:
    """Of one output: ratios to the yardstick and to autograd's error alone, worst cosine, bias."""
    told = [c for c in comparisons if c.norm > 0]
    ratios = [c.ratio for c in told]
    alone = [c.kernel_error / c.autograd_error for c in told if c.autograd_error > 0]
    return {
        "allowed ratio": told[0].factor,
        "median ratio": round(statistics.median(ratios), 3),
        "worst ratio": round(max(ratios), 3),
        "median error over autograd error": round(statistics.median(alone), 3),
        "median error": float(f"{statistics.median(c.kernel_error for c in told):.3g}"),
        "worst 1 - cosine": float(f"{max(1 - c.cosine for c in told):.3g}"),
        "median signed bias": float(f"{statistics.median(c.bias for c in told):.3g}"),
        "configurations": len(told),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, help="where to keep the result")
    arguments = parser.parse_args()
    by_output, failures = measure(arguments.rows, arguments.jobs)
    result: dict[str, Any] = {
        "machine_info": describe(),
        "datetime": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": f"python -m bench.kernel_accuracy --rows {arguments.rows}",
        "configurations": arguments.rows,
        "failures": failures,
        "outputs": {name: summary(comparisons) for name, comparisons in by_output.items()},
    }
    for name, line in result["outputs"].items():
        print(f"{name:>14}: median {line['median ratio']:.2f}, worst {line['worst ratio']:.2f}")
    print(f"{len(failures)} failures in {arguments.rows} configurations")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return int(bool(failures))


if __name__ == "__main__":
    raise SystemExit(main())
