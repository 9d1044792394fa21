"""The table of planted mistakes keeps in step with the code."""

from __future__ import annotations

import pytest

from bench.copied_tree import ROOT
from bench.studies.reliability.planted_mistakes import MISTAKES, TESTS, Mistake


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
