"""Gate V-4: plants one mistake after another and asks whether the tests notice.

    python -m bench.studies.reliability.planted_mistakes --jobs 16 --out FILE

The repository is copied and built once; each mistake gets a copy of that, compiles what it changes,
and runs the tests of its area, then all tests. A test counts if it passes without the mistake. The
record has a row for each mistake, with the test that caught it (null for a survivor); rows of an
earlier record in FILE stay unless they are tried again. Exit code 1: a mistake survived, 2: the
build failed. `--cuda` adds the mistakes that only a GPU can show.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench import copied_tree, movable_build
from bench.studies.reliability.planted_table import MISTAKES, TESTS, Mistake
from bench.studies.reliability.record import Record, command_of, joined, processor, read

FAILED = re.compile(r"^(?:FAILED|ERROR) ([^\s\[]+(?:\[.*?\](?= - |$))?)", re.MULTILINE)
QUICK, WHOLE = 900.0, 3600.0  # seconds for some folders, for the suite
ENOUGH = 5  # failures that end a run of the tests, once some failed anyway
ONE_THREAD = {"OMP_NUM_THREADS": "1"}
# The test of the table sees every planted mistake, and compiling alone takes minutes.
IGNORED = [
    "--ignore=tests/bench/test_planted_mistakes.py",
    "--ignore=tests/test_cuda_compiles.py",
    "--ignore=tests/docs",  # they need the packages that make the pages
]


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
            "update bench/studies/reliability/planted_table.py"
        )
    path.write_text(text.replace(mistake.old, mistake.new))
    try:
        yield
    finally:
        path.write_text(text)


@dataclass(frozen=True)
class Trial:
    """What the trials of all mistakes share.

    Attributes:
        base: the folder of the build without a mistake.
        quick: run the tests of the mistake's area alone.
        threads: compile so many files at once.
    """

    base: Path
    quick: bool
    threads: int

    def row(self, number: int, mistake: Mistake) -> dict[str, Any]:
        """Plants a mistake in a copy, builds, and runs tests until some fail."""
        begin = time.monotonic()
        tests = [TESTS[mistake.area], *([] if self.quick else [["tests"]])]
        with tempfile.TemporaryDirectory(dir=self.base.parent) as parent:
            folder = Path(parent) / "copy"
            movable_build.copy(self.base, folder)
            with planted(folder / "tree", mistake):
                error = mistake.compiled and movable_build.rebuild(folder, self.threads)
                caught = "the compiler" if error else ""
                for paths in tests:
                    caught = caught or self._catch(folder / "tree", paths)
        return {
            "id": number,
            **asdict(mistake),
            "tests": [path for paths in tests for path in paths],
            "caught_by": caught or None,
            "seconds": round(time.monotonic() - begin, 1),
            "device": processor(),
        }

    def _catch(self, tree: Path, paths: Sequence[str]) -> str:
        """The first test that fails with the mistake alone, or ""."""
        left_out: list[str] = []
        while True:
            options = [*IGNORED, f"--maxfail={ENOUGH if left_out else 1}"]
            deselected = [f"--deselect={test}" for test in left_out]
            limit = WHOLE if "tests" in paths else QUICK
            code, output = copied_tree.pytest(
                tree, [*options, *deselected, *paths], limit, ONE_THREAD
            )
            failed = FAILED.findall(output)
            if not failed:
                return f"{' '.join(paths)}: exit code {code}" if code else ""
            anyway = failing(self.base / "tree", failed)
            if healthy := [test for test in failed if test not in anyway]:
                return str(healthy[0])
            left_out += failed


def failing(tree: Path, tests: Sequence[str]) -> list[str]:
    """The tests that fail without a mistake too, as those that need an installed command."""
    code, output = copied_tree.pytest(tree, tests, WHOLE, ONE_THREAD)
    if code == 4:  # the name of a parameter was not found again
        functions = sorted({test.partition("[")[0] for test in tests})
        _, output = copied_tree.pytest(tree, functions, WHOLE, ONE_THREAD)
    return [found[1] for found in FAILED.finditer(output)]


def chosen(cuda: bool, only: Sequence[str], ids: Sequence[int]) -> list[tuple[int, Mistake]]:
    """The mistakes with their numbers, compiled ones first; `only`: beginnings of paths."""
    rows = [(i, m) for i, m in enumerate(MISTAKES) if cuda or not m.needs_gpu]
    rows = [(i, m) for i, m in rows if not only or m.file.startswith(tuple(only))]
    rows = [(i, m) for i, m in rows if not ids or i in ids]
    return sorted(rows, key=lambda row: not row[1].compiled)


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
    parser.add_argument("--jobs", type=int, default=1, help="mistakes tried side by side")
    parser.add_argument("--cuda", action="store_true", help="build for GPUs, with their mistakes")
    parser.add_argument("--only", nargs="*", default=[], help="files: beginnings of their paths")
    parser.add_argument("--ids", nargs="*", type=int, default=[], help="numbers of mistakes")
    parser.add_argument("--quick", action="store_true", help="the tests of the area alone")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin none after this")
    arguments = parser.parse_args()
    rows = chosen(arguments.cuda, arguments.only, arguments.ids)
    found = earlier(arguments.out)
    begin = time.monotonic()
    tried: list[dict[str, Any]] = []

    with tempfile.TemporaryDirectory() as parent:
        base = Path(parent).resolve() / "base"
        options = [f"-DGRANPINN_CUDA={'on' if arguments.cuda else 'off'}"]
        if any(mistake.compiled for _, mistake in rows):
            error = movable_build.build(base, options, arguments.jobs)
            if error:
                print(f"planted_mistakes: the build failed:\n{error}", file=sys.stderr)
                return 2
        else:
            copied_tree.copy_tree(base / "tree")
        print(f"ready to plant after {time.monotonic() - begin:.0f} s", flush=True)
        count = max(1, min(arguments.jobs, len(rows)))
        trial = Trial(base, arguments.quick, max(1, arguments.jobs // count))

        def work(number: int, mistake: Mistake) -> dict[str, Any] | None:
            late = time.monotonic() - begin > arguments.seconds
            return None if late else trial.row(number, mistake)

        with ThreadPoolExecutor(count) as pool:
            for done in as_completed([pool.submit(work, *row) for row in rows]):
                if row := done.result():
                    tried.append(row)
                    found[row["id"]] = row
                    print(json.dumps(row), flush=True)
                    write(list(found.values()), arguments)
    survivors = [row["id"] for row in tried if not row["caught_by"]]
    print(f"{len(tried)} of {len(rows)} mistakes tried, survivors: {survivors}")
    return int(bool(survivors))


def write(rows: Sequence[dict[str, Any]], arguments: argparse.Namespace) -> None:
    """The record of the mistakes tried so far, on all machines; its time is that of all trials."""
    seconds = sum(float(row["seconds"]) for row in rows)
    words = ["--quick"] * arguments.quick
    words += ["--cuda"] * any(MISTAKES[row["id"]].needs_gpu for row in rows)
    command = command_of("bench.studies.reliability.planted_mistakes", words)
    record = Record("V-4", command, seconds)
    rows = sorted(rows, key=lambda row: int(row["id"]))
    for row in rows:
        record.add("caught" if row["caught_by"] else "survived", None if row["caught_by"] else row)
    record.details = {"of": len(MISTAKES), "mistakes": rows}
    record.write(arguments.out, joined(row["device"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
