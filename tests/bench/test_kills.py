"""The short version of gate T-2: a run that is killed twice ends in the bits of one that is not."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from bench.studies.reliability import kills, runs
from tests.command.pageless import pageless

FLAGS = ["--steps", "600", *kills.FLAGS, "--simulated_pressure.frames", "1"]


def test_two_kills_change_no_bit(tmp_path: Path) -> None:
    flow = runs.make_flow(tmp_path / "flow.h5")
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    process = runs.start(pageless(runs.command(flow, whole, FLAGS)))
    _, err = process.communicate()
    assert process.returncode == 0, err
    newest = 0
    for _ in range(2):
        process = runs.start(pageless(runs.command(flow, killed, FLAGS)))
        before = set(killed.glob("checkpoint/step-*.json"))
        while process.poll() is None and set(killed.glob("checkpoint/step-*.json")) <= before:
            time.sleep(0.01)
        runs.end(process)
        process.communicate()
        reason, newest = kills.survived(killed, newest)
        assert reason == ""
    process = runs.start(pageless(runs.command(flow, killed, FLAGS)))
    _, err = process.communicate()
    assert process.returncode == 0, err
    assert runs.difference(whole, killed) is None


@pytest.mark.long
def test_other_bits_are_found(tmp_path: Path) -> None:
    flow = runs.make_flow(tmp_path / "flow.h5")
    flags = ["--steps", "10", *kills.FLAGS, "--simulated_pressure.frames", "0"]
    for name, seed in (("one", "0"), ("other", "1")):
        process = runs.start(
            pageless(runs.command(flow, tmp_path / name, [*flags, "--seed", seed]))
        )
        _, err = process.communicate()
        assert process.returncode == 0, err
    assert runs.difference(tmp_path / "one", tmp_path / "one") is None
    assert (runs.difference(tmp_path / "one", tmp_path / "other") or "").startswith("results.json")


def test_lost_steps_are_found(tmp_path: Path) -> None:
    assert kills.survived(tmp_path, 0) == ("", 0)
    assert kills.survived(tmp_path, 5) == ("the checkpoints are gone", 5)
