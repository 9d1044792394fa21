"""The page "How it is tested" is made from the records."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from bench.studies.reliability.record import Record
from tests.docs.test_site import ROOT, hook

PAGE = hook("reliability")


def test_every_test_that_the_page_names_exists() -> None:
    for gate in PAGE.KEPT_BY_TESTS:
        for path in gate.tests:
            assert (ROOT / path).is_file(), path


def test_records_that_do_not_exist_are_not_run(tmp_path: Path) -> None:
    text = "\n".join(PAGE.records(tmp_path))
    assert text.count("not run") == len(PAGE.KEPT_BY_COMMANDS)
    assert "`python -m bench.studies.reliability.mutants" in text


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


def test_a_record_of_another_author_is_shown(tmp_path: Path) -> None:
    """Only the common keys, no details."""
    common = {"gate": "T-2", "date": "2026-01-01", "versions": {"granpinn": "1"}, "device": "a CPU"}
    more = {"command": "c", "seconds": 1, "tried": 2, "outcomes": {"ok": 2}, "failures": []}
    (tmp_path / "kills-cpu.json").write_text(json.dumps(common | more))
    text = "\n".join(PAGE.records(tmp_path))
    assert "| 2 | 0 | 2 ok | 1 s |" in text


@pytest.mark.parametrize("name", ["mutants", "output_faults"])
def test_commands_exist(name: str) -> None:
    assert importlib.util.find_spec(f"bench.studies.reliability.{name}") is not None
