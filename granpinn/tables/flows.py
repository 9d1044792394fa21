"""The flows of a study: files that are given, or the six regimes, simulated once and kept."""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from granpinn.config import ConfigError
from granpinn.data import Flow, FlowFileError, read_flow, write_flow
from granpinn.data.flow import SOLVER_CELL
from granpinn.output import make_folder
from granpinn.simulation import PAPER_CASES, Collapse, simulate
from granpinn.simulation.engine import StepReport
from granpinn.simulation.threads import threads

Say = Callable[[str], None]

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


def _simulate(missing: list[tuple[Collapse, Path]], say: Say) -> None:
    """Simulate side by side in threads: the compiled solver releases Python's lock."""
    cores = len(os.sched_getaffinity(0))
    at_once = min(cores, len(missing))
    share = max(1, cores // at_once)
    say(f"simulating {len(missing)} collapses, {at_once} at a time, {share} threads each")
    begin, stopped = time.monotonic(), threading.Event()

    def heard(_: StepReport) -> None:
        if stopped.is_set():
            raise KeyboardInterrupt

    def one(collapse: Collapse, path: Path) -> None:
        scene = dataclasses.replace(collapse, threads=share)
        write_flow(simulate(scene, listener=heard), path)
        say(f"simulated {path.name} after {time.monotonic() - begin:.0f} s")

    try:
        with threads(at_once) as pool:
            for job in [pool.submit(one, collapse, path) for collapse, path in missing]:
                job.result()
    except BaseException:
        stopped.set()  # the others end at their next step
        raise
