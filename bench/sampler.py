"""Samples the stacks of all Python threads of one process while it runs a command.

    python -m bench.sampler FILE.json granpinn.train FLOW.h5 --out DIR

A thread looks at all stacks every 5 ms. It adds the time since its last look to the functions that
it finds. So the command runs as fast as without it, and C++ code counts for its Python caller.
This file loads the standard library alone: the imports of the command are a part of the result.
"""

from __future__ import annotations

import json
import runpy
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

EVERY = 0.005  # seconds between two looks
PACKAGE = "granpinn"
IMPORTER = "<frozen importlib._bootstrap>"
START, IMPORTS, REST = "start of Python", "imports", "the rest"
PHASES = {  # of the main thread, by its innermost function of this table
    "command/arguments.py parse": "words of the command",
    "identification/case.py sound": "reading and checks",
    "fit/case.py posed": "posing",
    "fit/case.py members": "posing",
    "identification/start.py prepare": "writing",
    "identification/start.py start": "set-up of the training",
    "training/loop.py train": "training",
    "training/loop.py _save": "checkpoints",
    "training/trainer.py solve_last_layer": "last layer",
    "identification/answer.py valued": "values",
    "fit/prediction.py predict": "prediction",
    "identification/answer.py with_intervals": "assumptions",
    "identification/answer.py with_curve": "curve",
    "checks/momentum_balance.py make": "momentum balance",
    "checks/comparison_of_laws.py make": "comparison of laws",
    "checks/simulated_pressure.py make": "simulated pressure",
    "results/results_file.py write_results": "writing",
    "results/results_csv.py write_csv": "writing",
    "results/fields.py write_fields": "writing",
    "results/fields.py append_variable": "writing",
    "fit/network.py write_network": "writing",
    "figures/album.py draw_all": "figures",
    "report/page.py build": "page",
    "concurrent/futures/_base.py result": "wait for other threads",
}


class Place(NamedTuple):
    """A function: its file, from the folder of its package on, and its name."""

    file: str
    name: str

    def __str__(self) -> str:
        return f"{self.file} {self.name}"


class Samples:
    """The time of every phase of the main thread, and of every function of the package."""

    def __init__(self) -> None:
        self.begin = self.last = time.monotonic()
        self.timeline: list[tuple[str, float, float]] = []  # phase, begin and end
        self.of_main: dict[Place, float] = defaultdict(float)
        self.of_others: dict[Place, float] = defaultdict(float)
        self._main, self._own = threading.main_thread().ident, 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Samples:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        self._own = threading.get_ident()
        while not self._ended.wait(EVERY):
            self._look()

    def _look(self) -> None:
        stacks = sys._current_frames()
        now = time.monotonic()
        for thread, frame in stacks.items():
            if thread == self._own:
                continue
            places = list(places_of(frame))
            totals = self.of_main if thread == self._main else self.of_others
            for place in {p for p in places if p.file.startswith(f"{PACKAGE}/")}:
                totals[place] += now - self.last
            if thread == self._main:
                self._add(phase_of(places), now)
        self.last = now

    def _add(self, phase: str, now: float) -> None:
        if self.timeline and self.timeline[-1][0] == phase:
            self.timeline[-1] = (phase, self.timeline[-1][1], now)
        else:
            self.timeline.append((phase, self.last, now))

    def found(self) -> dict[str, Any]:
        """Times of the phases in their order and of the functions, in seconds; for JSON."""
        rows = [
            {
                "function": str(place),
                "main_s": round(self.of_main[place], 3),
                "others_s": round(self.of_others[place], 3),
            }
            for place in {*self.of_main, *self.of_others}
        ]
        return {
            "begin": self.begin,
            "end": time.monotonic(),
            "timeline": self.timeline,
            "rows": sorted(rows, key=lambda row: -row["main_s"] - row["others_s"]),
        }


def places_of(frame: FrameType | None) -> Iterator[Place]:
    """The functions of a stack, the innermost first."""
    while frame is not None:
        code = frame.f_code
        parts = code.co_filename.split("/")
        first = max((k for k, part in enumerate(parts) if part == PACKAGE), default=-3)
        yield Place("/".join(parts[first:]), code.co_name)
        frame = frame.f_back


def phase_of(places: list[Place]) -> str:
    """The phase of a stack: imports if it loads a module, else its innermost function of PHASES."""
    if any(place.file == IMPORTER for place in places):
        return IMPORTS
    names = (str(place).removeprefix(f"{PACKAGE}/") for place in places)
    return next((PHASES[name] for name in names if name in PHASES), REST)


def sampled(out: Path, run: Callable[[], object]) -> None:
    """Run a command, and write its samples, also if it ends the process."""
    samples = Samples()
    try:
        with samples:
            run()
    finally:
        out.write_text(json.dumps(samples.found()))


def main() -> None:
    out, module, *words = sys.argv[1:]
    sys.argv = [module, *words]
    sampled(Path(out), lambda: runpy.run_module(module, run_name="__main__", alter_sys=True))


if __name__ == "__main__":
    main()
