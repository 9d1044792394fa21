"""The host sanitizers: every test file runs once, side by side, and one record counts all."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from bench import copied_tree, sanitize_host
from bench.studies.reliability.record import read


def test_files_run_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def check(tree: Path, tests: str, kernels: str) -> dict[str, Any]:
        assert (copied_tree.ROOT / tests).is_file()
        return {
            "tests": tests,
            "kernels": kernels,
            "passed": 2,
            "exit_code": int("balance" in tests),
            "reports": [],
            "seconds": 0.1,
        }

    monkeypatch.setattr(sanitize_host, "check", check)
    monkeypatch.setattr(copied_tree, "copy_tree", lambda *_, **__: None)
    monkeypatch.setattr(copied_tree, "build", lambda *_: "")
    out = tmp_path / "record.json"
    monkeypatch.setattr(sys, "argv", ["sanitize_host", "--shards", "4", "--out", str(out)])
    assert sanitize_host.main() == 1
    found = read(out)
    count = len(sanitize_host.files_of(sanitize_host.TESTS))
    assert count == len(found["details"]["cases"]) > len(sanitize_host.TESTS)
    assert found["outcomes"] == {"failure or report": 1, "passed": 2 * count}
