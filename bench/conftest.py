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
