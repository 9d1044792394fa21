"""Gate V-4: plants one mistake after another and asks whether the tests notice.

    python -m bench.studies.reliability.planted_mistakes --out FILE

planted_mistakes.csv has the mistakes. The repository is copied and built once. Each mistake is
planted in the copy, which compiles what it changes and runs the tests of its area, then all tests;
those that fail without a mistake do not count. The record has a row for each mistake, with the test
that caught it (null for a survivor); rows of an earlier record in FILE stay unless they are tried
again. Exit code 1: a mistake survived, 2: the build failed. `--cuda` adds the mistakes that only a
GPU can show.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from bench import copied_tree
from bench.studies.reliability.record import Record, command_of, joined, processor, read

FAILED = re.compile(r"^(?:FAILED|ERROR) ([^\s\[]+(?:\[.*?\](?= - |$))?)", re.MULTILINE)
QUICK, WHOLE = 900.0, 3600.0  # seconds for some folders, for the suite
# The test of the table sees every planted mistake, and compiling alone takes minutes.
IGNORED = [
    "--ignore=tests/bench/test_planted_mistakes.py",
    "--ignore=tests/test_cuda_compiles.py",
    "--ignore=tests/docs",  # they need the packages that make the pages
]


# Those that see most come first. The operators' own checks take longer and see little more.
KERNELS = (
    *("pointwise", "viscosity", "laws", "law_update", "arguments", "sampling", "network", "step"),
    *("gradients", "orthogonalize", "determinism", "small_work", "cuda", "accuracy"),
)
SOLVER = ("laws", "bagnold", "side_walls", "fraction", "smooth_flows", "balance", "collapse")

# The tests that could notice a mistake first, by area, in a minute or two; the suite follows.
TESTS = {
    "kernels": [f"tests/kernels/test_{name}.py" for name in KERNELS],
    "cuda": [f"tests/kernels/test_{name}.py" for name in KERNELS],
    "solver": [f"tests/simulation/test_{name}.py" for name in SOLVER],
    "physics": ["tests/physics", "tests/config", "tests/kernels/test_viscosity.py"],
    "data": ["tests/physics", "tests/data"],
    "units": [
        "tests/importers/test_units.py",
        "tests/importers/test_convert.py",
    ],
    "training": [
        "tests/training/test_schedule.py",
        "tests/training/test_objective.py",
        "tests/training/test_optimise.py",
        "tests/training/test_last_layer.py",
        "tests/training/test_law_variables.py",
        "tests/training/test_graphs.py",
        "tests/identification/test_members.py",
    ],
    "identification": ["tests/identification", "tests/fit", "tests/results"],
    "uncertainty": ["tests/uncertainty"],
    "results": ["tests/results", "tests/identification"],
    "simulation": ["tests/simulation/test_collapse.py", "tests/simulation/test_command.py"],
    "inspection": ["tests/inspection"],
    "side walls": [
        "tests/training/test_objective.py",
        "tests/inspection/test_side_walls.py",
        "tests/identification/test_side_walls.py",
    ],
    "walls": ["tests/data/test_walls.py", "tests/data/test_variants.py"],
    "strip": [
        "tests/data/test_surface_strip.py",
        "tests/data/test_variants.py",
        "tests/checks/test_profile_of_I0.py",
    ],
}


@dataclass(frozen=True)
class Mistake:
    """One wrong line: the old text must occur exactly once in its file.

    Attributes:
        area: a key of TESTS.
        kind: sign, factor, index, missing term, wrong constant, or unit.
    """

    area: str
    kind: str
    file: str
    old: str
    new: str

    @property
    def compiled(self) -> bool:
        return self.file.startswith("csrc/")

    @property
    def needs_gpu(self) -> bool:
        return self.area == "cuda"


with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
    MISTAKES = [Mistake(**row) for row in csv.DictReader(file)]


@contextmanager
def planted(tree: Path, mistake: Mistake) -> Iterator[None]:
    """The copy with the mistake in it.

    Raises:
        ValueError: the old text does not occur exactly once.
    """
    path = tree / mistake.file
    text = path.read_text()
    count = text.count(mistake.old)
    if count != 1:
        raise ValueError(
            f"{mistake.file} must contain {mistake.old!r} once, found {count} times: "
            "update bench/studies/reliability/planted_mistakes.csv"
        )
    path.write_text(text.replace(mistake.old, mistake.new))
    try:
        yield
    finally:
        path.write_text(text)


def row(tree: Path, number: int, quick: bool, build: Sequence[str]) -> dict[str, Any]:
    """Plants a mistake, builds, and runs tests until one fails.

    Args:
        quick: run the tests of the mistake's area alone.
        build: options of CMake.
    """
    begin, mistake = time.monotonic(), MISTAKES[number]
    tests = [tuple(TESTS[mistake.area]), *([] if quick else [("tests",)])]
    anyway = [failing(tree, paths) for paths in tests]
    with planted(tree, mistake):
        error = mistake.compiled and copied_tree.build(tree, tree.with_name("cmake"), build)
        caught = "the compiler" if error else ""
        for paths, known in zip(tests, anyway, strict=True):
            caught = caught or catch(tree, paths, known)
    if mistake.compiled:
        copied_tree.build(tree, tree.with_name("cmake"), build)
    return {
        "id": number,
        **asdict(mistake),
        "tests": [path for paths in tests for path in paths],
        "caught_by": caught or None,
        "seconds": round(time.monotonic() - begin, 1),
        "device": processor(),
    }


@cache
def failing(tree: Path, paths: tuple[str, ...]) -> list[str]:
    """The tests that fail without a mistake, as those that need an installed command."""
    return FAILED.findall(_run(tree, paths)[1])


def catch(tree: Path, paths: Sequence[str], known: Sequence[str]) -> str:
    """The first test that fails, but for those that are `known` to fail; "" if there is none."""
    code, output = _run(tree, ["--maxfail=1", *(f"--deselect={test}" for test in known), *paths])
    failed = FAILED.findall(output)
    return str(failed[0]) if failed else f"exit code {code}" if code else ""


def _run(tree: Path, words: Sequence[str]) -> tuple[int, str]:
    limit = WHOLE if "tests" in words else QUICK
    return copied_tree.pytest(tree, [*IGNORED, *words], limit, {"OMP_NUM_THREADS": "1"})


def chosen(cuda: bool, ids: Sequence[int]) -> list[int]:
    """The numbers of the mistakes, compiled ones first."""
    rows = [i for i, m in enumerate(MISTAKES) if (cuda or not m.needs_gpu) and i in (ids or [i])]
    return sorted(rows, key=lambda i: not MISTAKES[i].compiled)


def earlier(path: Path) -> dict[int, dict[str, Any]]:
    """The rows of a record by their numbers, without those that the table has changed since."""
    if not path.is_file():
        return {}
    rows = {int(row["id"]): row for row in read(path)["details"]["mistakes"]}
    return {
        i: row
        for i, row in rows.items()
        if i < len(MISTAKES) and asdict(MISTAKES[i]).items() <= row.items()
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file, written as it goes")
    parser.add_argument("--cuda", action="store_true", help="build for GPUs, with their mistakes")
    parser.add_argument("--ids", nargs="*", type=int, default=[], help="numbers of mistakes")
    parser.add_argument("--quick", action="store_true", help="the tests of the area alone")
    own = parser.parse_args()
    found = earlier(own.out)
    tried: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as parent:
        tree = Path(parent).resolve() / "tree"
        build = [f"-DGRANPINN_CUDA={'on' if own.cuda else 'off'}"]
        copied_tree.copy_tree(tree, compiled=False)
        if error := copied_tree.build(tree, tree.with_name("cmake"), build):
            print(f"planted_mistakes: the build failed:\n{error}", file=sys.stderr)
            return 2
        for number in chosen(own.cuda, own.ids):
            tried.append(row(tree, number, own.quick, build))
            found[number] = tried[-1]
            print(json.dumps(tried[-1]), flush=True)
            write(list(found.values()), own)
    survivors = [row["id"] for row in tried if not row["caught_by"]]
    print(f"{len(tried)} mistakes tried, survivors: {survivors}")
    return int(bool(survivors))


def write(rows: Sequence[dict[str, Any]], own: argparse.Namespace) -> None:
    """The record of the mistakes tried so far, on all machines; its time is that of all trials."""
    words = ["--quick"] * own.quick + ["--cuda"] * any(MISTAKES[r["id"]].needs_gpu for r in rows)
    command = command_of("bench.studies.reliability.planted_mistakes", words)
    record = Record("V-4", command, sum(float(row["seconds"]) for row in rows))
    rows = sorted(rows, key=lambda row: int(row["id"]))
    for row in rows:
        record.add("caught" if row["caught_by"] else "survived", None if row["caught_by"] else row)
    record.details = {"of": len(MISTAKES), "mistakes": rows}
    record.write(own.out, joined(row["device"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
