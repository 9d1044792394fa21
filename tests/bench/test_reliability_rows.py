"""Rows of several runs make one record, also if a run was killed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.studies.reliability import rows
from bench.studies.reliability.record import read


def row(mutant: str, outcome: str = "ok", **others: Any) -> dict[str, Any]:
    numbers = {"seconds": 0.5, "memory_ratio": 0.1, "warnings": 0, "failed": outcome == "hang"}
    names = {"format": "flow", "command": "train", "mutant": mutant, "outcome": outcome}
    return {**names, **numbers, "class": "x", "at": 7, **others}


def run(path: Path, *found: dict[str, Any], tail: str = "") -> Path:
    rows.begin(path, f"python -m {path.stem}")
    with path.open("a") as stream:
        stream.writelines(json.dumps(one) + "\n" for one in found)
        stream.write(tail)
    return path


def test_a_mutant_counts_once_and_a_failure_stays(tmp_path: Path) -> None:
    first = run(tmp_path / "a.rows", row("1"), row("2", "hang", at=9), tail='{"format": "fl')
    second = run(tmp_path / "b.rows", row("2"), row("3"), {**row("1"), "command": "inspect"})
    out = tmp_path / "mutants.json"
    assert rows.main([str(first), str(second), "--out", str(out)]) == 1
    found = read(out)
    assert found["outcomes"] == {"hang": 1, "ok": 3}
    assert found["details"]["classes"] == {"flow train: hang: x": 1}
    assert found["command"] == "python -m a\npython -m b"
    assert found["seconds"] == 16
    assert found["versions"]["torch"].count("and") == 0


def test_a_format_that_one_run_could_not_read(tmp_path: Path) -> None:
    missing = {"format": "flow", "command": "train", "not run": ["zarr"]}
    alone, ran = run(tmp_path / "a.rows", missing), run(tmp_path / "b.rows", row("1"))
    assert rows.merged([alone])["details"]["not run"] == {"flow train": ["zarr"]}
    assert "not run" not in rows.merged([alone, ran])["details"]


def test_other_machines_are_named(tmp_path: Path) -> None:
    paths = [run(tmp_path / f"{name}.rows", row(name)) for name in "ab"]
    head = json.loads(paths[0].read_text().splitlines()[0])
    head["run"] |= {"device": "other, 16 cores", "versions": {"torch": "2.11.0"}}
    paths[0].write_text(json.dumps(head) + "\n")
    found = rows.merged(paths)
    assert found["device"].startswith("other, 16 cores and ")
    assert found["versions"]["torch"].startswith("2.11.0 and ")


def test_faults_tell_how_many_of_how_many(tmp_path: Path) -> None:
    rows.begin(tmp_path / "a.rows", "python -m a", "F-5, T-3")
    fault = {"case": "train", "mode": "no space", "outcome": "ok", "failed": False, "after": 4}
    count = {"case": "train", "faults": 840}
    found = [count, count, {**fault, "at": 1}, {**fault, "at": 2, "after": 9}, {**fault, "at": 2}]
    with (tmp_path / "a.rows").open("a") as stream:
        stream.writelines(json.dumps(one) + "\n" for one in found)
        stream.write('{"case": "tra')
    assert rows.main([str(tmp_path / "a.rows"), "--out", str(tmp_path / "a.json")]) == 0
    whole = read(tmp_path / "a.json")
    assert whole["gate"] == "F-5, T-3"
    assert whole["seconds"] == 9
    assert whole["details"]["cases"] == {"train": {"faults": 840, "tried": 2, "ok": 2}}
