"""The GPU benchmark without a GPU: the arithmetic of its table, its rows, and failed rows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import torch

from bench.steps import fused_step, make_task


def test_members_of_an_ensemble_have_parts_of_the_points() -> None:
    task = make_task("mixed", 12, torch.float64)
    together = fused_step(task.ensemble(3))()
    assert together.shape == (3,)
    assert float(together.mean()) == pytest.approx(float(fused_step(task)()), rel=1e-12)
    assert task.ensemble(3).flop == task.flop


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
