"""Gate V-4: plants one mistake after another and asks whether the tests notice.

    python -m bench.studies.reliability.planted_mistakes --out FILE

planted_mistakes.csv has the mistakes. The repository is copied and built once. Each mistake is
planted in the copy, which compiles what it changes and runs the tests of its area; tests that fail
without a mistake do not count. The record has a row for each mistake, with the test that caught it
(null for a survivor). Exit code 1: a mistake survived, 2: the build failed. `--cuda` adds the
mistakes that only a GPU can show.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from bench import copied_tree
from bench.studies.reliability.record import recorded

FAILED = re.compile(r"^(?:FAILED|ERROR) ([^\s\[]+(?:\[.*?\](?= - |$))?)", re.MULTILINE)
LIMIT = 1800.0  # seconds for the tests of an area

# The tests that could notice a mistake, by area. Those that see most come first.
TESTS = {
    "kernels": ["tests/kernels"],
    "cuda": ["tests/kernels"],
    "solver": ["tests/simulation"],
    "physics": ["tests/physics", "tests/config", "tests/kernels/test_viscosity.py"],
    "data": ["tests/physics", "tests/data"],
    "units": ["tests/importers/test_units.py", "tests/importers/test_convert.py"],
    "training": ["tests/training", "tests/identification/test_members.py"],
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
    "walls": ["tests/data/test_walls.py", "tests/training/test_variants.py"],
    "strip": [
        "tests/data/test_surface_strip.py",
        "tests/training/test_variants.py",
        "tests/fit/test_loss.py",
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


def caught_by(tree: Path, mistake: Mistake, build: Sequence[str]) -> str:
    """The first test that fails with the mistake, or the compiler; "" for a survivor."""
    tests = tuple(TESTS[mistake.area])
    known = failing(tree, tests)
    with planted(tree, mistake):
        if mistake.compiled and copied_tree.build(tree, tree.with_name("cmake"), build):
            return "the compiler"
        code, output = _pytest(
            tree, ["--maxfail=1", *(f"--deselect={test}" for test in known), *tests]
        )
    if mistake.compiled:
        copied_tree.build(tree, tree.with_name("cmake"), build)
    failed = FAILED.findall(output)
    return str(failed[0]) if failed else f"exit code {code}" if code else ""


@cache
def failing(tree: Path, paths: tuple[str, ...]) -> list[str]:
    """The tests that fail without a mistake, as those that need an installed command."""
    return FAILED.findall(_pytest(tree, paths)[1])


def _pytest(tree: Path, words: Sequence[str]) -> tuple[int, str]:
    return copied_tree.pytest(tree, words, LIMIT, {"OMP_NUM_THREADS": "1"})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file")
    parser.add_argument("--cuda", action="store_true", help="build for GPUs, with their mistakes")
    parser.add_argument("--ids", nargs="*", type=int, default=[], help="numbers of mistakes")
    own = parser.parse_args()
    module = "bench.studies.reliability.planted_mistakes"
    with tempfile.TemporaryDirectory() as parent:
        tree = Path(parent).resolve() / "tree"
        build = [f"-DGRANPINN_CUDA={'on' if own.cuda else 'off'}"]
        copied_tree.copy_tree(tree)
        if error := copied_tree.build(tree, tree.with_name("cmake"), build):
            print(f"planted_mistakes: the build failed:\n{error}", file=sys.stderr)
            return 2
        with recorded("V-4", module, own.out) as record:
            rows = record.details["mistakes"] = []
            for number, mistake in enumerate(MISTAKES):
                if (own.ids and number not in own.ids) or (mistake.needs_gpu and not own.cuda):
                    continue
                begin, caught = time.monotonic(), caught_by(tree, mistake, build)
                row = {"id": number, **asdict(mistake), "caught_by": caught or None}
                row["seconds"] = round(time.monotonic() - begin, 1)
                rows.append(row)
                record.add("caught" if caught else "survived", None if caught else row)
                print(row, flush=True)
    return int(bool(record.failures))


if __name__ == "__main__":
    sys.exit(main())
