"""Adds the machine, the versions and the command to a stored benchmark.

pytest bench --benchmark-json=bench/results/cpu_step.json
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from bench.fma_peak import fma_peak
from bench.machine import describe


@pytest.fixture
def threads(request: pytest.FixtureRequest) -> Any:
    """Sets the number of threads that the test is parametrized with ("all": every core)."""
    before = torch.get_num_threads()
    torch.set_num_threads(describe()["cores"] if request.param == "all" else request.param)
    yield torch.get_num_threads()
    torch.set_num_threads(before)


def pytest_benchmark_update_json(
    config: pytest.Config, benchmarks: list[Any], output_json: dict[str, Any]
) -> None:
    """Keep medians and spread instead of every sample, and add the machine and the command."""
    output_json["machine_info"] = machine_info()
    output_json["command"] = shlex.join(["pytest", *map(_relative, sys.argv[1:])])
    output_json.pop("commit_info", None)
    for entry in output_json["benchmarks"]:
        keep = ("min", "median", "iqr", "rounds")
        entry["stats"] = {name: entry["stats"][name] for name in keep}


def _relative(argument: str) -> str:
    """The argument without the path of the checkout, which differs on every machine."""
    return argument.replace(f"{Path.cwd()}/", "")


def pytest_benchmark_generate_machine_info() -> dict[str, Any]:
    return machine_info()


def machine_info() -> dict[str, Any]:
    """The machine, and the multiply-add peak of one of its cores."""
    return describe() | {"fma_peak_gflops": round(fma_peak(), 1)}


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the table of the claims in process CPU time, which other processes disturb least."""
    session = getattr(terminalreporter.config, "_benchmarksession", None)
    rows = [b.extra_info for b in getattr(session, "benchmarks", []) if "cpu_ms" in b.extra_info]
    if not rows:
        return
    peak = fma_peak()
    machine = describe()
    terminalreporter.section("one optimization step, process CPU time")
    terminalreporter.write_line(
        f"{machine['processor']}, {machine['cores']} cores, {machine['kernels']}, "
        f"multiply-add peak {peak:.1f} GFLOP/s per core"
    )
    eager = {key(row): row["cpu_ms"] for row in rows if row["step"] == "eager autograd"}
    for row in rows:
        gain = f"{eager[key(row)] / row['cpu_ms']:6.2f}x eager" if key(row) in eager else ""
        terminalreporter.write_line(
            f"{row['form']:>7} B {row['points']:>5} threads {row['threads']} "
            f"{row['step']:>15} {row['cpu_ms']:9.1f} ms CPU {row['wall_ms']:9.1f} ms wall "
            f"{row['gflops']:6.1f} GFLOP/s per core ({row['gflops'] / peak:4.0%} of the peak) "
            f"{gain}"
        )


def key(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["form"], row["points"], row["threads"]
