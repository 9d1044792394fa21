"""Gate K-6 on the host: tests of the kernels and of the simulator under ASan and UBSan.

    python -m bench.sanitize_host --out bench/studies/reliability/results/sanitizers.json

Builds a copy of the repository with -fsanitize=address,undefined. The first
report ends the test process. Exit code 0: no report, and no test failed. Needs g++ and its libasan.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import product
from pathlib import Path
from typing import Any

from bench import copied_tree
from bench.studies.reliability.record import recorded

BUILD = ["-DGRANPINN_SANITIZE=ON", "-DGRANPINN_CUDA=off", "-DCMAKE_CXX_FLAGS_RELEASE=-O1"]

# Small work alone: tests that time something or import other compiled libraries stay out.
# The longest come first, so that no process waits for them at the end.
TESTS = [
    "tests/simulation",
    "tests/kernels/test_hostile_calls.py",
    "tests/kernels/test_operators.py",
    "tests/kernels/test_step.py",
    "tests/kernels/test_arguments.py",
    "tests/kernels/test_law_update.py",
    "tests/kernels/test_laws.py",
    "tests/kernels/test_orthogonalize.py",
    "tests/kernels/test_pointwise.py",
    "tests/kernels/test_sampling.py",
    "tests/kernels/test_viscosity.py",
]
# It limits the memory of a process, and the sanitizer itself needs more than that.
LEFT_OUT = "test_threads_that_do_not_start_are_one_sentence"
REPORT = re.compile(r"ERROR: AddressSanitizer: .*|runtime error: .*")


def library(name: str) -> str:
    """The path of a library of the compiler."""
    command = ["g++", f"-print-file-name={name}"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def environment(kernels: str) -> dict[str, str]:
    """Settings of the sanitizers; Python's own memory is never freed, so leaks are not counted."""
    options = "detect_leaks=0:allocator_may_return_null=1:max_allocation_size_mb=2048"
    return {
        "LD_PRELOAD": f"{library('libasan.so')} {library('libstdc++.so.6')}",
        "ASAN_OPTIONS": options,
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "OMP_NUM_THREADS": "2",
        "GRANPINN_CPU": kernels,
    }


def files_of(tests: Iterable[str]) -> list[str]:
    """Test files, and those of folders, the largest first."""
    paths = [copied_tree.ROOT / name for name in tests]
    files = [f for p in paths for f in (p.glob("test_*.py") if p.is_dir() else [p])]
    files.sort(key=lambda file: -file.stat().st_size)
    return [str(file.relative_to(copied_tree.ROOT)) for file in files]


def check(tree: Path, tests: str, kernels: str) -> dict[str, Any]:
    """Runs some tests with the kernels of one instruction set; what they showed."""
    begin = time.monotonic()
    options = ["-k", f"not cuda and not {LEFT_OUT}", "-o", "timeout=900", "-W", "ignore", tests]
    code, output = copied_tree.pytest(tree, options, 1800, environment(kernels))
    passed = re.search(r"(\d+) passed", output)
    reports = REPORT.findall(output)
    for line in reports:
        print(f"  {line}")
    if code:
        print(output[-3000:])
    return {
        "tests": tests,
        "kernels": kernels,
        "passed": int(passed[1]) if passed else 0,
        "exit_code": code,
        "reports": reports,
        "seconds": round(time.monotonic() - begin, 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="JSON file with tests, reports and times")
    parser.add_argument("--kernels", nargs="+", default=["avx512"], help="avx512, avx2, generic")
    parser.add_argument("--shards", type=int, default=1, help="processes of the tests")
    own = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        recorded("K-6", "bench.sanitize_host", own.out) as record,
        ThreadPoolExecutor(own.shards) as pool,
    ):
        tree = Path(folder) / "tree"
        copied_tree.copy_tree(tree)
        if error := copied_tree.build(tree, Path(folder) / "cmake", BUILD):
            print(f"sanitize_host: the build failed:\n{error}", file=sys.stderr)
            return 2
        record.details["cases"] = {}
        cases = product(files_of(TESTS), own.kernels)
        for done in as_completed([pool.submit(check, tree, *case) for case in cases]):
            row = done.result()
            print(json.dumps(row), flush=True)
            record.add("passed", count=row["passed"])
            if row["exit_code"] or row["reports"]:
                record.add("failure or report", row)
            counted = {name: row[name] for name in ("passed", "seconds")}
            record.details["cases"][f"{row['tests']}, {row['kernels']}"] = counted
    return int(bool(record.failures))


if __name__ == "__main__":
    sys.exit(main())
