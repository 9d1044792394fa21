"""The page "How it is tested" is made from the records."""

from __future__ import annotations

from pathlib import Path

from bench.studies.reliability.record import RESULTS, Record, read
from tests.docs.test_site import ROOT, hook

PAGE = hook("reliability")


def test_every_test_that_the_page_names_exists() -> None:
    for gate in PAGE.KEPT_BY_TESTS:
        for path in gate.tests:
            assert (ROOT / path).is_file(), path


def test_the_records_of_the_repository_can_be_read() -> None:
    paths = sorted(RESULTS.glob("*.json"))
    assert paths
    assert all(read(path)["tried"] > 0 for path in paths)


def test_a_record_is_shown_with_its_numbers(tmp_path: Path) -> None:
    record = Record("F-2", command="python -m bench.studies.x", seconds=7300)
    for seed in range(3000):
        record.add("refused" if seed else "hang", None if seed else {"repeat": "--only `0`"})
    record.details = {"formats": {"flow train": {"refused": 3000, "seconds": 1.234}}}
    record.write(tmp_path / PAGE.KEPT_BY_COMMANDS[0].record)
    text = "\n".join(PAGE.records(tmp_path))
    assert "| 3,000 | 1 | 2,999 refused, 1 hang | 2.0 h |" in text
    assert "| flow train | refused 3,000, seconds 1.23 |" in text
    assert "python -m bench.studies.x" in text
    assert "repeat: --only  0 " in text
