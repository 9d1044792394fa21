"""The GPU benchmark without a GPU: the arithmetic of its table, its rows, and failed rows."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest
import torch
from torch.utils._pytree import tree_map_only

from bench import (
    device,
    fma_peak,
    gpu_accuracy,
    gpu_step,
    gpu_training,
    parallel,
    processes,
    rivals,
)
from bench.machine import describe
from bench.rivals import OURS, Rival
from bench.steps import fused_step, make_task
from granpinn.config import Config

CPU = torch.device("cpu")


def row(name: str, points: int, ms: float, form: str = "strong") -> dict[str, Any]:
    return {"name": name, "ms": ms, "form": form, "points": points}


def test_ratios_are_to_rows_of_the_same_form_and_size() -> None:
    rows = [
        row(OURS["fp32"], 512, 0.1),
        row(OURS["fast"], 512, 0.01),
        row("jets", 512, 0.25),
        row("other", 512, 0.5),
        row("jets", 512, 0.001, "mixed"),
        row("jets", 4096, 0.002),
        row(OURS["fast"], 32768, 1.0, "mixed"),
        {"name": "broken", "form": "strong", "points": 512, "error": "OutOfMemoryError"},
    ]
    gpu_step.complete(rows)
    assert rows[0]["best_rival"] == "jets"
    assert rows[0]["times_faster"] == pytest.approx(2.5)
    assert [r.get("goal_ms") for r in rows] == [0.08, 0.05, *[None] * 4, 0.6 * 1.8, None]
    assert "best_rival" not in rows[6]
    text = gpu_step.text(rows)
    assert "2.50x jets  goal 0.08 ms" in text
    assert re.search(r"broken +strong +512 OutOfMemoryError", text)


def test_members_of_an_ensemble_have_parts_of_the_points() -> None:
    task = make_task("mixed", 12, torch.float64)
    together = fused_step(task.ensemble(3))()
    assert together.shape == (3,)
    assert float(together.mean()) == pytest.approx(float(fused_step(task)()), rel=1e-12)
    assert task.ensemble(3).flop == task.flop


def test_a_failure_is_a_row() -> None:
    def broken(task: Any) -> Any:
        raise RuntimeError("no such kernel\nand more")

    found = rivals.measure(Rival("broken", broken, False), "strong", 8, CPU)
    assert found.row["error"] == "RuntimeError: no such kernel"
    assert found.advance is None
    gone = rivals.measure(
        Rival("diverged", lambda task: lambda: torch.tensor(torch.nan), False), "strong", 8, CPU
    )
    assert gone.row["error"] == "ArithmeticError: the loss became nan"
    assert "ms" not in gone.row


def test_time_is_that_of_one_step() -> None:
    calls: list[int] = []
    ms = device.milliseconds(lambda: calls.append(sum(range(20_000))), CPU, seconds=0.05)
    assert 0.01 < ms < 50
    assert len(calls) > 5


def test_the_rule_is_about_the_median_over_copies() -> None:
    found = gpu_accuracy.judged([[0.5, 7.0, 1.0], [2.0, 3.0, 0.0], [0.0, 1.5, 1.5]])
    assert (found["ratio"], found["range"], found["rule_kept"]) == (1.5, [1.0, 2.0], True)
    assert not gpu_accuracy.judged([[3.0, 1.0, 2.0]])["rule_kept"]


def test_copies_differ_by_some_roundings() -> None:
    network = gpu_accuracy.random_network("mixed")
    first, second = network.copies(2)
    (again,) = network.copies(1)
    assert torch.equal(first, again)
    change = (first.double() / network.params.double() - 1).std()
    assert float(change) == pytest.approx(gpu_accuracy.COPIED, rel=0.05)
    assert not torch.equal(first, second)


@pytest.mark.parametrize("times", [1, 3])
def test_errors_of_a_mode_that_errs_more(times: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mode "fast" errs `times` as much as "fp32" does; a CPU has one mode."""
    exact: Any = gpu_accuracy.ops.residual_loss

    def loss(*arguments: Any, precision: str = "fp32") -> list[torch.Tensor]:
        out = list(exact(*arguments))
        if precision == "fast":
            truth = exact(*tree_map_only(torch.Tensor, torch.Tensor.double, arguments))
            pairs = zip(out, truth, strict=True)
            out = [times * a.double() - (times - 1) * b for a, b in pairs]
        return out

    monkeypatch.setattr(gpu_accuracy.ops, "residual_loss", loss)
    found = gpu_accuracy.ratios(gpu_accuracy.random_network("mixed"), CPU, 16, 0, 2)
    assert [len(values) for values in found] == [gpu_accuracy.BATCHES] * 2
    assert found[0] + found[1] == pytest.approx([times] * 2 * gpu_accuracy.BATCHES, rel=1e-6)
    line = gpu_accuracy.text([{"form": "mixed"} | gpu_accuracy.judged(found)])
    assert line.endswith("3.00 (3.00 to 3.00), above 1.5" if times == 3 else "(1.00 to 1.00)")


def test_rate_of_a_training_leaves_the_prefit_out() -> None:
    config = Config(steps=1000, log_every=100)
    marks = gpu_training.Marks([(100, 0.0), (200, 9.0), (500, 10.0), (700, 12.0), (1000, 15.0)])
    assert marks.rate(config) == 100


def test_members_of_several_processes_add_up() -> None:
    one = {"work": "members", "processes": 1, "members": 24, "steps_per_s": 100.0}
    two = one | {"processes": 2, "members": 48, "steps_per_s": 95.0}
    assert parallel.with_gain(two, [one])["times_one"] == pytest.approx(1.9)
    batch = {"work": "batch", "processes": 1, "members": 0, "steps_per_s": 100.0}
    shared = batch | {"processes": 2, "steps_per_s": 180.0}
    assert parallel.with_gain(shared, [one, batch])["times_one"] == pytest.approx(1.8)
    assert (
        parallel.with_gain({"work": "batch", "processes": 2, "error": "x"}, [batch])["error"] == "x"
    )


def test_lines_of_a_process_that_fails() -> None:
    code = "import sys; print('{\"a\": 1}'); print('noise'); sys.exit('out of memory')"
    lines, reason = processes.run_lines([sys.executable, "-c", code], None, 60)
    assert lines == [{"a": 1}]
    assert reason == "out of memory"


def test_the_multiply_add_peak_is_that_of_a_core() -> None:
    assert 1 < fma_peak.fma_peak(0.02) < 1000


def test_a_peak_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(RuntimeError, match="must be a C\\+\\+ compiler, got No such file"):
        fma_peak.fma_peak(0.03)


def test_a_benchmark_states_the_processor() -> None:
    assert len(describe()["processor"]) > 3


STUDIES = Path(__file__).parents[2] / "bench" / "studies"
NOTES = sorted(STUDIES.glob("**/note.md"))


@pytest.mark.parametrize("note", NOTES, ids=lambda note: note.parent.name)
def test_a_note_has_question_setting_and_answer(note: Path) -> None:
    lines = note.read_text().splitlines()
    assert len(lines) <= 60
    assert max(len(line) for line in lines if line[:1] != "|") <= 120  # tables may be wider
    assert re.fullmatch(r"# .+\?", lines[0])
    assert "## Setting" in lines
    assert any(line.startswith("## Answer") for line in lines)


@pytest.mark.parametrize("note", NOTES, ids=lambda note: note.parent.name)
def test_a_note_names_results_and_commands_that_exist(note: Path) -> None:
    text = note.read_text()
    for name in re.findall(r"`(results/[^`]+)`", text):
        assert list(note.parent.glob(name)), name
    for link in re.findall(r"\]\((\.\.?/[^)#]+|results/[^)#]+)", text):
        if "docs/" not in link:
            assert (note.parent / link).exists(), link
    for module in re.findall(r"python -m (bench\.[\w.]+)", text):
        assert (STUDIES.parents[1] / f"{module.replace('.', '/')}.py").exists(), module


def test_every_study_has_a_note_in_the_index_of_the_evidence() -> None:
    index = (STUDIES.parents[1] / "docs" / "evidence" / "index.md").read_text()
    studies = {path.name for path in STUDIES.iterdir() if path.is_dir() and path.name[0] != "_"}
    listed = set(re.findall(r"bench/studies/([\w/]+)/note\.md", index))
    assert listed == {note.parent.relative_to(STUDIES).as_posix() for note in NOTES}
    assert studies == {name.split("/")[0] for name in listed}
