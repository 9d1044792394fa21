"""The table of planted mistakes keeps in step with the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.copied_tree import ROOT
from bench.studies.reliability.planted_mistakes import MISTAKES, TESTS, Mistake, planted


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda m: f"{m.file}-{m.kind}")
def test_a_mistake_still_applies(mistake: Mistake) -> None:
    text = (ROOT / mistake.file).read_text()
    assert text.count(mistake.old) == 1
    assert mistake.old != mistake.new
    assert mistake.area in TESTS


def test_there_are_mistakes_of_every_kind() -> None:
    assert len([m for m in MISTAKES if not m.needs_gpu]) >= 40
    kinds = {"sign", "factor", "index", "missing term", "wrong constant", "unit"}
    assert {m.kind for m in MISTAKES} == kinds
    assert all((ROOT / path).exists() for paths in TESTS.values() for path in paths)


def test_planting_restores_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("x = 1\n")
    mistake = Mistake("data", "factor", "a.py", "x = 1", "x = 2")
    with planted(tmp_path, mistake):
        assert (tmp_path / "a.py").read_text() == "x = 2\n"
    assert (tmp_path / "a.py").read_text() == "x = 1\n"
    with pytest.raises(ValueError, match=r"a\.py must contain 'x = 3' once, found 0 times"):  # noqa: SIM117
        with planted(tmp_path, Mistake("data", "factor", "a.py", "x = 3", "")):
            pass
