"""The record of a gate of bench/studies/reliability."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.studies.reliability.record import RESULTS, read


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.name)
def test_the_records_of_the_repository_can_be_read(path: Path) -> None:
    assert read(path)["tried"] > 0
