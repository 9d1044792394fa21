"""Gate V-4: plants one mistake after another and asks whether the tests notice.

    python -m bench.studies.reliability.planted_mistakes --jobs 16 --out FILE

Each worker has a copy of the repository and builds it there. Tests that fail without a mistake are
left out. The record has a row for each mistake, with the test that caught it (null for a survivor).
Exit code 1: a mistake survived. `--cuda` adds the mistakes that only a GPU can show.
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
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from bench import copied_tree
from bench.studies.reliability.planted_table import MISTAKES, TESTS, Mistake
from bench.studies.reliability.record import Record, command_of

FAILED = re.compile(r"^(?:FAILED|ERROR) ([^\s\[]+(?:\[.*?\](?= - |$))?)", re.MULTILINE)
QUICK, WHOLE = 900.0, 3600.0  # seconds for some folders, for the suite
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


class Worker:
    """A copy of the repository with a build of its own."""

    def __init__(self, folder: Path, options: Sequence[str], threads: int) -> None:
        self.tree, self.cmake = folder / "tree", folder / "cmake"
        self.options, self.threads = options, threads
        self.outdated = False  # the modules have the mistake of before
        copied_tree.copy_tree(self.tree)

    def build(self) -> str:
        return copied_tree.build(self.tree, self.cmake, self.options, self.threads)

    def try_out(self, number: int, mistake: Mistake, left_out: Sequence[str]) -> dict[str, Any]:
        """Plants a mistake, builds, and runs tests until one fails."""
        begin = time.monotonic()
        with planted(self.tree, mistake):
            rebuild = mistake.compiled or self.outdated
            caught = "the compiler" if rebuild and self.build() else ""
            self.outdated = mistake.compiled
            caught = caught or self._catch(mistake, left_out)
        return {
            "id": number,
            "file": mistake.file,
            "area": mistake.area,
            "kind": mistake.kind,
            "old": mistake.old,
            "new": mistake.new,
            "caught_by": caught or None,
            "seconds": round(time.monotonic() - begin, 1),
        }

    def _catch(self, mistake: Mistake, left_out: Sequence[str]) -> str:
        deselected = [f"--deselect={test}" for test in left_out]
        for paths, limit in ((TESTS[mistake.area], QUICK), (["tests"], WHOLE)):
            code, output = copied_tree.pytest(
                self.tree, ["-x", *IGNORED, *deselected, *paths], limit, ONE_THREAD
            )
            if code:
                found = FAILED.search(output)
                return found[1] if found else f"{' '.join(paths)}: exit code {code}"
        return ""


def failing(tree: Path, path: str) -> list[str]:
    """The tests of a path that fail without a mistake, as those that need an installed command."""
    code, output = copied_tree.pytest(tree, [*IGNORED, path], WHOLE, ONE_THREAD)
    if code not in (0, 1, 5):  # 5: no test there
        raise RuntimeError(f"{path} must run without a mistake, got:\n{output[-2000:]}")
    return FAILED.findall(output)


def chosen(cuda: bool, only: Sequence[str]) -> list[tuple[int, Mistake]]:
    """The mistakes with their numbers; `only`: beginnings of paths."""
    rows = [(i, m) for i, m in enumerate(MISTAKES) if cuda or not m.needs_gpu]
    return [(i, m) for i, m in rows if not only or m.file.startswith(tuple(only))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file, written as it goes")
    parser.add_argument("--jobs", type=int, default=1, help="copies that work side by side")
    parser.add_argument("--cuda", action="store_true", help="build for GPUs, with their mistakes")
    parser.add_argument("--only", nargs="*", default=[], help="files: beginnings of their paths")
    parser.add_argument("--left-out", nargs="*", help="tests that fail anyway; tried if not given")
    arguments = parser.parse_args()
    rows = chosen(arguments.cuda, arguments.only)
    options = [f"-DGRANPINN_CUDA={'on' if arguments.cuda else 'off'}"]
    found: list[dict[str, Any]] = []
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        count = max(1, min(arguments.jobs, len(rows)))
        threads = max(1, arguments.jobs // count)
        idle: SimpleQueue[Worker] = SimpleQueue()
        workers = [Worker(Path(folder) / str(i), options, threads) for i in range(count)]
        with ThreadPoolExecutor(count) as pool:
            if any(m.compiled for _, m in rows):
                for error in pool.map(Worker.build, workers):
                    if error:
                        print(f"planted_mistakes: the build failed:\n{error}", file=sys.stderr)
                        return 2
            left_out = arguments.left_out
            if left_out is None:
                tests = (workers[0].tree / "tests").iterdir()
                paths = sorted(f"tests/{p.name}" for p in tests if p.is_dir() or "test_" in p.name)
                broken = pool.map(lambda path: failing(workers[0].tree, path), paths)
                left_out = [test for part in broken for test in part]
            print(f"left out, because they fail anyway: {left_out}", flush=True)
            for worker in workers:
                idle.put(worker)

            def work(number: int, mistake: Mistake) -> dict[str, Any]:
                worker = idle.get()
                try:
                    return worker.try_out(number, mistake, left_out)
                finally:
                    idle.put(worker)

            for done in as_completed([pool.submit(work, *row) for row in rows]):
                found.append(done.result())
                print(json.dumps(found[-1]), flush=True)
                record_of(found, time.monotonic() - begin).write(arguments.out)
    survivors = [row for row in found if not row["caught_by"]]
    print(f"{len(found) - len(survivors)} of {len(found)} mistakes caught")
    return int(bool(survivors))


def record_of(rows: Sequence[dict[str, Any]], seconds: float) -> Record:
    """The record of the mistakes tried so far."""
    record = Record("V-4", command_of("bench.studies.reliability.planted_mistakes"), seconds)
    for row in sorted(rows, key=lambda row: int(row["id"])):
        record.add("caught" if row["caught_by"] else "survived", None if row["caught_by"] else row)
    record.details = {"of": len(MISTAKES), "mistakes": list(rows)}
    return record


if __name__ == "__main__":
    sys.exit(main())
