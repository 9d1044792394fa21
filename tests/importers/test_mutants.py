"""Gate F-2: mutants of measurement files of every format are read or refused in one sentence.

Neither the command nor the process of libraries crashes, hangs, opens other files or takes more
than three times the memory of the valid file.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.studies.reliability.mutants import main as mutants
from bench.studies.reliability.record import read


@pytest.mark.parametrize(
    "count", [2, pytest.param(500, marks=[pytest.mark.long, pytest.mark.timeout(36_000)])]
)
def test_mutants(count: int, tmp_path: Path) -> None:
    out = tmp_path / "mutants.json"
    words = ["--command", "convert", "--seeds", f"0:{count}", "--out", str(out)]
    assert mutants(words) == 0, out.read_text()
    record = read(out)
    assert record["tried"] > 12 * count
    assert 0 < record["outcomes"]["refused"] < record["tried"]
