"""The record of a gate of bench/studies/reliability."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.studies.reliability.record import KEPT, RESULTS, Record, command_of, read


def test_a_record_is_written_and_read(tmp_path: Path) -> None:
    record = Record("F-2", command=command_of("bench.studies.x", ["--out", "a b.json"]))
    for seed in range(KEPT + 5):
        record.add("hang", {"seed": seed})
    record.add("refused")
    record.write(tmp_path / "a.json")
    found = read(tmp_path / "a.json")
    assert found["command"] == "python -m bench.studies.x --out 'a b.json'"
    assert found["outcomes"] == {"hang": KEPT + 5, "refused": 1}
    assert (found["tried"], found["failed"], len(found["failures"])) == (KEPT + 6, KEPT + 5, KEPT)
    assert {"gate", "date", "versions", "device", "seconds"} <= set(found)


def test_outcomes_that_do_not_add_up_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"tried": 3, "outcomes": {"ok": 2}}))
    with pytest.raises(ValueError, match="must add up to 3"):
        read(path)


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.name)
def test_the_records_of_the_repository_can_be_read(path: Path) -> None:
    assert read(path)["tried"] > 0
