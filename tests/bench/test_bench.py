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
    gpu_table,
    gpu_training,
    parallel,
    processes,
    rivals,
)
from bench.jets import jets_step
from bench.rivals import EAGER, OURS, Rival
from bench.steps import fused_step, make_task
from granpinn.config import Config

CPU = torch.device("cpu")
CEILINGS = {"sgemm_tflops": 50.0, "tf32_tflops": 350.0, "copy_tb_per_s": 4.0}
JETS = "jets"


def row(name: str, points: int, ms: float, form: str = "strong") -> dict[str, Any]:
    size = {"form": form, "points": points, "flop": 5e6 * points, "traffic": 4e6}
    return {"name": name, "ms": ms} | size


def test_ratios_are_to_rows_of_the_same_form_and_size() -> None:
    ours = row(OURS["fp32"], 512, 0.1) | {"peak_gb": 0.02, "resident_mb": 2.1}
    rows = [
        ours,
        row(OURS["fast"], 512, 0.01),
        row(EAGER, 512, 20.0),
        row(JETS, 512, 0.25),
        row("other", 512, 0.5),
        row(JETS, 512, 0.001, "mixed"),
        row(JETS, 4096, 0.002),
        {"name": "broken", "form": "strong", "points": 512, "error": "OutOfMemoryError"},
    ]
    gpu_table.complete(rows, CEILINGS, l2_mb=50.0)
    assert ours["stays_in_l2"] is True
    assert "stays_in_l2" not in rows[3]  # its memory is not known
    assert ours["times_faster_than_eager"] == pytest.approx(200)
    assert ours["best_rival"] == JETS
    assert ours["times_faster_than_best_rival"] == pytest.approx(2.5)
    assert ours["tflops"] == pytest.approx(5e6 * 512 / 0.1e-3 / 1e12)
    assert ours["of_sgemm"] == pytest.approx(ours["tflops"] / 50)
    assert ours["of_copy"] == pytest.approx(4e6 / 0.1e-3 / 4e12)
    assert ours["goal_reached"] is False
    assert "best_rival" not in rows[2]
    assert rows[3]["times_faster_than_eager"] == pytest.approx(80)
    text = gpu_table.text(rows)
    assert "2.50x jets; goal 0.08 ms MISSED" in text
    assert "broken, strong, B = 512: OutOfMemoryError" in text


@pytest.mark.parametrize(
    ("form", "precision", "points", "goal"),
    [
        ("strong", "fp32", 512, 0.08),
        ("strong", "fast", 262144, 13.0),
        ("mixed", "fast", 32768, 0.6 * 1.8),
        ("strong", "fp32", 4096, None),
    ],
)
def test_goals(form: str, precision: str, points: int, goal: float | None) -> None:
    assert gpu_table.goal_ms(row(OURS[precision], points, 1.0, form)) == goal


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_jets_by_hand_are_the_same_step(form: str) -> None:
    """The loss of the first step; later ones differ, as ours moves the variables of mu(I)."""
    ours, jets = (make(make_task(form, 16, torch.float64))() for make in (fused_step, jets_step))
    torch.testing.assert_close(jets, ours, rtol=1e-12, atol=0)


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


def test_ratio_of_gradient_errors() -> None:
    own = {"fast": [3.0, 1.0, 8.0], "fp32": [1.0, 1.0, 4.0], "eager float32": [2.0, 1.0, 8.0]}
    found = gpu_accuracy.ratios(own, [])
    assert (found["fast_over_fp32"], found["fp32_over_eager"]) == (2.0, 0.5)
    assert (found["ratios"], found["rule_kept"]) == ([[3.0, 1.0, 2.0]], False)


def test_the_rule_is_about_the_median_over_copies() -> None:
    own = {"fast": [9.0], "fp32": [1.0], "eager float32": [1.0]}
    copies = [
        {"fast": [1.0, 7.0, 2.0], "fp32": [2.0, 1.0, 2.0]},
        {"fast": [4.0, 3.0, 0.0], "fp32": [2.0, 1.0, 0.0]},
        {"fast": [0.0, 3.0, 3.0], "fp32": [1.0, 2.0, 2.0]},
    ]
    found = gpu_accuracy.ratios(own, copies)
    assert found["ratios"] == [[0.5, 7.0, 1.0], [2.0, 3.0, 0.0], [0.0, 1.5, 1.5]]
    assert found["fast_over_fp32"] == 1.5
    assert found["fast_over_fp32_range"] == [1.0, 2.0]
    assert found["fast_over_fp32_as_it_is"] == 9.0
    assert (found["copies"], found["rule_kept"]) == (3, True)


def test_copies_differ_by_some_roundings() -> None:
    network = gpu_accuracy.random_network("mixed")
    first, second = network.copies(2)
    (again,) = network.copies(1)
    assert torch.equal(first, again)
    change = (first.double() / network.params.double() - 1).std()
    assert float(change) == pytest.approx(gpu_accuracy.COPIED, rel=0.05)
    assert not torch.equal(first, second)


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_errors_against_float64(form: str) -> None:
    found = gpu_accuracy.errors(gpu_accuracy.random_network(form), CPU, 16, 0, 2)
    assert found["ratios"] == [[1.0] * gpu_accuracy.BATCHES] * 2  # a CPU has one mode
    for name in ("fp32", "eager float32"):
        assert 0 < found[name]["gradient"] < 1e-4
    assert found["float64"]["gradient"] < 1e-12


def test_errors_of_a_mode_that_errs_more(monkeypatch: pytest.MonkeyPatch) -> None:
    exact: Any = gpu_accuracy.ops.residual_loss

    def loss(*arguments: Any, precision: str = "fp32") -> list[torch.Tensor]:
        """The mode "fast" errs three times as much as "fp32" does."""
        out = list(exact(*arguments))
        if precision == "fast":
            truth = exact(*tree_map_only(torch.Tensor, torch.Tensor.double, arguments))
            out = [3 * a.double() - 2 * b for a, b in zip(out, truth, strict=True)]
        return out

    monkeypatch.setattr(gpu_accuracy.ops, "residual_loss", loss)
    row = {"weights": "some"} | gpu_accuracy.errors(
        gpu_accuracy.random_network("mixed"), CPU, 16, 0, 2
    )
    assert row["fast_over_fp32"] == pytest.approx(3, rel=1e-6)
    assert "3.00 (3.00 to 3.00 over 2 copies) above 1.5" in gpu_accuracy.text([row])


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


def test_numbers_of_the_file_are_rounded() -> None:
    assert gpu_step.rounded({"a": [0.123456, 7, "x"], "b": None}) == {
        "a": [0.1235, 7, "x"],
        "b": None,
    }


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
