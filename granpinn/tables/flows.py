"""The flows of a study: files that are given, or the six regimes, simulated once and kept."""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from granpinn.config import ConfigError
from granpinn.data import Flow, FlowFileError, read_flow, write_flow
from granpinn.data.flow import SOLVER_CELL
from granpinn.output import make_folder
from granpinn.simulation import PAPER_CASES, Collapse, simulate
from granpinn.simulation.engine import StepReport

Say = Callable[[str], None]

SAY_EVERY = 10.0  # seconds
SUFFIXES = (".h5", ".hdf5", ".nc")


def given(paths: Iterable[Path]) -> list[Flow]:
    """The flows of files and of all flow files in folders, by name; every name at most once.

    Raises:
        ConfigError: there is no file. FlowFileError: a file is not a flow file.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix in SUFFIXES)
            if not inside:
                raise ConfigError(f"{path} holds no flow file ({', '.join(SUFFIXES)})")
            files += inside
        else:
            files.append(path)
    twice = {path.stem for path in files if sum(p.stem == path.stem for p in files) > 1}
    if twice:
        raise ConfigError(
            f"the flow files must have names of their own, got {sorted(twice)[0]} twice: rename one"
        )
    return [read_flow(path) for path in files]


def six_regimes(folder: Path, cells: int, stride: int | None, say: Say) -> list[Flow]:
    """The paper's six regimes from files in `folder`; those that are missing are simulated.

    Each simulation uses one or more cores. A file appears when it is complete.

    Args:
        stride: spacing of the stored points in cells; None for the paper's spacing, 12/128.
    """
    wanted = [Collapse(mu_s, mu_2, cells=cells) for mu_s, mu_2 in PAPER_CASES]
    if stride is None:
        stride = max(1, round(cells / 128))
    wanted = [dataclasses.replace(c, stride=stride) for c in wanted]
    make_folder(folder)
    paths = [folder / f"collapse_{c.mu_s:.2f}_{c.mu_2:.2f}.h5" for c in wanted]
    missing = [(c, path) for c, path in zip(wanted, paths, strict=True) if not _holds(path, c)]
    if missing:
        _simulate(missing, say)
    return [read_flow(path) for path in paths]


def _holds(path: Path, collapse: Collapse) -> bool:
    """Whether a file holds the complete flow of a collapse."""
    try:
        flow = read_flow(path)
    except (FlowFileError, OSError):
        return False
    c, facts, truth = collapse.resolved(), flow.attributes, flow.truth
    return (
        truth is not None
        and (truth.mu_s, truth.mu_2, truth.I0) == (c.mu_s, c.mu_2, c.I0)
        and (facts.get(SOLVER_CELL), facts.get("stride")) == (c.spacing, c.stride)
        and len(flow.t) == c.frames
        and flow.grain_diameter == c.d
    )


class _Board:
    """One line every ten seconds with the progress of each simulation."""

    def __init__(self, say: Say) -> None:
        self.say, self.done = say, dict[str, float]()
        self.last = time.monotonic()
        self.stop = False
        self.lock = threading.Lock()

    def heard(self, name: str, done: float) -> None:
        if self.stop:
            raise KeyboardInterrupt
        with self.lock:
            self.done[name] = done
            now = time.monotonic()
            if now - self.last < SAY_EVERY:
                return
            self.last = now
            parts = [f"{name} {100 * part:.0f} %" for name, part in self.done.items()]
        self.say(f"simulating: {', '.join(parts)}")


def _simulate(missing: list[tuple[Collapse, Path]], say: Say) -> None:
    """Simulate side by side in threads: the compiled solver releases Python's lock."""
    cores = len(os.sched_getaffinity(0))
    at_once = min(cores, len(missing))
    threads = max(1, cores // at_once)
    say(f"simulating {len(missing)} collapses, {at_once} at a time, {threads} threads each")
    board, begin = _Board(say), time.monotonic()

    def one(collapse: Collapse, path: Path) -> None:
        scene = dataclasses.replace(collapse, threads=threads).resolved()
        name, t_end = path.stem.removeprefix("collapse_"), scene.t_end
        assert t_end is not None

        def heard(report: StepReport) -> None:
            board.heard(name, report.time / t_end)

        write_flow(simulate(scene, listener=heard), path)
        say(f"simulated {path.name} after {time.monotonic() - begin:.0f} s")

    with ThreadPoolExecutor(at_once) as pool:
        jobs = [pool.submit(one, collapse, path) for collapse, path in missing]
        try:
            for job in jobs:
                job.result()
        except BaseException:
            board.stop = True  # the others end at their next step
            for job in jobs:
                job.cancel()
            raise
