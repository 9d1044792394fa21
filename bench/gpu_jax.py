"""The step of bench/jax_step.py on a GPU, timed in a process of its own; a line of JSON per row.

python -m bench.gpu_jax --form strong --points 512 4096

JAX has no device events: a row is the wall clock of many steps with one wait at their end, by calls
of the jitted step or, for small batches, in a scan. Products are float32, as in all other rows.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from typing import Any

import jax

from bench.jax_step import jax_training
from bench.steps import make_task

CALLS, SCAN = "JAX jit, Taylor jets", "JAX jit, Taylor jets in a scan"
SMALL = 4096
IN_SCAN = 50


def milliseconds(advance: Callable[[Any], Any], state: Any, steps: int) -> float:
    """Median time of a step over samples of about 50 ms, of a function with several steps."""

    def sample(repeats: int) -> float:
        nonlocal state
        begin = time.perf_counter()
        for _ in range(repeats):
            state, _ = advance(state)
        jax.block_until_ready(state)
        return 1e3 * (time.perf_counter() - begin) / repeats

    sample(3)
    repeats = max(1, round(50 / sample(1)))
    return statistics.median(sample(repeats) for _ in range(7)) / steps


def rows(form: str, points: int) -> list[dict[str, Any]]:
    task = make_task(form, points)
    once, state = jax_training(task)

    def many(state: Any) -> Any:
        return jax.lax.scan(lambda s, _: once(s), state, None, IN_SCAN)

    ways = [(CALLS, once, 1)] + [(SCAN, many, IN_SCAN)] * (points <= SMALL)
    out = []
    for name, function, steps in ways:
        row: dict[str, Any] = {"name": name, "form": form, "points": points}
        row["jax"] = jax.__version__
        try:
            row["ms"] = milliseconds(jax.jit(function), state, steps)
            used = jax.devices()[0].memory_stats() or {}
            if "peak_bytes_in_use" in used:  # of this process so far: batches come in rising order
                row["peak_gb"] = used["peak_bytes_in_use"] / 1e9
        except Exception as error:
            row["error"] = f"{type(error).__name__}: {str(error).strip()[:300]}"
        out.append(row)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--form", choices=["strong", "mixed"], required=True)
    parser.add_argument("--points", type=int, nargs="+", required=True)
    arguments = parser.parse_args()
    jax.config.update("jax_default_matmul_precision", "highest")
    for points in sorted(arguments.points):
        for row in rows(arguments.form, points):
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
