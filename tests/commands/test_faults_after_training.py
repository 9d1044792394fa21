"""Whatever fails after the last step, the law is on the disk, or `--resume` makes it.

A fault is raised at one statement of granpinn after another, from the last checkpoint of a training
to the end of the command, in all threads.
"""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import granpinn
from granpinn import results, signals
from granpinn.data import Flow, write_flow
from granpinn.training.loop import TrainingLoop
from tests.commands.late_parts import run
from tests.commands.pageless import stand_ins
from tests.flows import make_flow

PACKAGE = str(Path(granpinn.__file__).parent)
SAMPLE = 12  # statements in the suite; all with -m long


class Fault(Exception):
    """The planted error."""


class Tracer:
    """Counts the statements of granpinn that run for the first time; raises at one of them."""

    def __init__(self, at: int | None) -> None:
        self.at, self.seen, self.place = at, set[tuple[str, int]](), ""

    def __call__(self, frame: FrameType, event: str, arg: Any) -> Any:
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        statement = frame.f_code.co_filename, frame.f_lineno
        if event == "line" and not self.place and statement not in self.seen:
            self.seen.add(statement)
            if len(self.seen) == self.at:
                self.place = f"{statement[0].removeprefix(PACKAGE)}:{statement[1]}"
                raise Fault(self.place)
        return self

    def begin(self) -> None:
        frame: FrameType | None = sys._getframe()
        while frame is not None:  # calls that have begun
            if frame.f_code.co_filename.startswith(PACKAGE):
                frame.f_trace = self
            frame = frame.f_back
        threading.settrace(self)
        sys.settrace(self)


def finish(folder: Path, at: int | None) -> Tracer:
    """Resume a training at its end, with a fault at a statement."""
    tracer, real = Tracer(at), TrainingLoop._loop

    def loop(self: TrainingLoop, caught: signals.Signals) -> None:
        tracer.begin()
        real(self, caught)

    before = sys.gettrace()
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(TrainingLoop, "_loop", loop)
            run("--out", folder, "--resume")
    except Fault:  # at the edge of the command
        pass
    finally:
        threading.settrace(None)  # type: ignore[arg-type]
        sys.settrace(before)
    return tracer


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, results.Result]]:
    """A run folder as it is after the last step, and the result of the whole run."""
    folder = tmp_path_factory.mktemp("faults")
    flow: Flow = make_flow()
    write_flow(flow, folder / "flow.h5")
    with pytest.MonkeyPatch.context() as patch:
        for owner, name, value in stand_ins():
            patch.setattr(owner, name, value)
        assert run(folder / "flow.h5", "--out", folder / "run") == 0
        result = results.read_results(folder / "run" / "results.json")
        for name in ("results.json", "fields.h5", "network.safetensors"):
            (folder / "run" / name).unlink()
        yield folder / "run", result


def lost(at: int, trained: tuple[Path, results.Result], folder: Path) -> str:
    """What a fault destroyed, with its place; "" if nothing."""
    run_dir, result = trained
    shutil.copytree(run_dir, folder / "run")
    tracer = finish(folder / "run", at)
    shutil.copytree(folder / "run", folder / "again")  # whose lock is free in any case
    shutil.rmtree(folder / "run")
    found = folder / "again" / "results.json"
    try:
        if not found.exists():
            run("--out", folder / "again", "--resume")
        kept = results.read_results(found).theta == result.theta
    except Exception as error:
        return f"{tracer.place}: {type(error).__name__}: {error}"
    finally:
        shutil.rmtree(folder / "again")
    return "" if kept else f"{tracer.place}: another law"


@pytest.fixture(scope="module")
def count(trained: tuple[Path, results.Result], tmp_path_factory: pytest.TempPathFactory) -> int:
    """The number of statements after the last step."""
    folder = tmp_path_factory.mktemp("counted") / "run"
    shutil.copytree(trained[0], folder)
    return len(finish(folder, None).seen)


@pytest.mark.parametrize("part", range(SAMPLE))
def test_a_fault_after_the_last_step_loses_nothing(
    part: int, trained: tuple[Path, results.Result], count: int, tmp_path: Path
) -> None:
    assert count > 500
    assert lost(1 + (2 * part + 1) * count // (2 * SAMPLE), trained, tmp_path) == ""


@pytest.mark.long
@pytest.mark.timeout(36_000)
def test_a_fault_at_any_statement_after_the_last_step_loses_nothing(
    trained: tuple[Path, results.Result], count: int, tmp_path: Path
) -> None:
    assert [text for at in range(1, count + 1) if (text := lost(at, trained, tmp_path))] == []
