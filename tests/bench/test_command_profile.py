"""The profile of the command: its seconds, its phases, and the functions that take them."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path

import pytest

from bench import command_profile, sampler
from granpinn import train
from granpinn.second_opinion.threads import threads
from tests.command.late_parts import FLAGS

WORDS = [*FLAGS, "--steps", "300"]  # six steps may be over between two looks
SLOW = "import time; print('heading', flush=True); time.sleep({}); print('mu_s 0.4', flush=True)"


def test_the_answer_comes_between_the_first_line_and_the_exit() -> None:
    found = command_profile.timed([sys.executable, "-c", SLOW.format(0.2)])
    assert 0 < found["first_line_s"] <= found["answer_s"] - 0.15 < found["exit_s"]
    assert found["cpu_s"] > 0


def test_a_command_that_fails_has_no_times() -> None:
    with pytest.raises(SystemExit, match="ended with 3"):
        command_profile.timed([sys.executable, "-c", "raise SystemExit(3)"])


def test_every_phase_has_a_function() -> None:
    """A function that was renamed or moved would lose its phase without a word."""
    folder = Path(train.__file__).parent
    for place in sampler.PHASES:
        file, name = place.split()
        if file != "concurrent/futures/_base.py":
            assert f"def {name}(" in (folder / file).read_text(encoding="utf-8"), place


def test_a_phase_is_that_of_the_innermost_known_function() -> None:
    def place(text: str) -> sampler.Place:
        return sampler.Place(*text.split())

    stack = [
        place("torch/nn.py relu"),
        place("granpinn/training/loop.py train"),
        place("granpinn/identification/single.py identify"),
    ]
    assert sampler.phase_of(stack) == "training"
    assert sampler.phase_of([place("granpinn/training/loop.py _save"), *stack]) == "checkpoints"
    assert sampler.phase_of(stack[2:]) == sampler.REST
    assert sampler.phase_of([sampler.Place(sampler.IMPORTER, "_load"), *stack]) == sampler.IMPORTS


def test_threads_of_python_are_sampled_apart() -> None:
    """The end of the block `threads` waits for what was submitted."""

    def rest(seconds: float) -> None:
        with threads(1) as pool:
            pool.submit(time.sleep, seconds)

    beside = threading.Thread(target=rest, args=(0.4,))
    samples = sampler.Samples()
    with samples:
        beside.start()
        rest(0.2)
        beside.join()
    name = "granpinn/second_opinion/threads.py threads"
    (row,) = (row for row in samples.found()["rows"] if row["function"] == name)
    assert row["main_s"] == pytest.approx(0.2, abs=0.1)
    assert row["others_s"] == pytest.approx(0.4, abs=0.1)


@pytest.mark.usefixtures("no_report")
def test_the_phases_and_functions_of_a_run(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def timed(words: list[str]) -> dict[str, float]:
        """The command within this process: it takes as long to load torch as to train."""
        command = words[words.index("granpinn.train") + 1 :]
        if "bench.sampler" in words:
            path = Path(words[words.index("bench.sampler") + 1])
            sampler.sampled(path, lambda: train.main(command))
        return {"exit_s": 1.0}

    monkeypatch.setattr(command_profile, "timed", timed)
    out = tmp_path / "profile.json"
    words = ["command_profile", "--json", str(out), "--flow", str(flow_file), "--", *WORDS]
    monkeypatch.setattr(sys, "argv", words)
    assert command_profile.main() == 0
    found = json.loads(out.read_text())
    assert (found["module"], found["words"]) == ("granpinn.train", WORDS)
    assert found["flow"] == [flow_file.name]
    names = [row["function"] for row in found["rows"]]
    assert "granpinn/identification/single.py identify" in names
    totals = [row["main_s"] + row["others_s"] for row in found["rows"]]
    assert totals == sorted(totals, reverse=True)
    phases = {row["phase"]: row for row in found["timeline"]}
    assert next(iter(phases)) == sampler.START
    assert list(phases)[-1] == command_profile.EXIT
    assert (
        phases["posing"]["from_s"] < phases["training"]["from_s"] < phases["last layer"]["from_s"]
    )
    whole = phases[command_profile.EXIT]["to_s"]
    assert sum(row["seconds"] for row in phases.values()) == pytest.approx(whole, abs=0.2)
    assert str(tmp_path) not in out.read_text()
