"""The short version of gate T-2: a run that is killed twice ends in the bits of one that is not."""

from __future__ import annotations

import time
from pathlib import Path

from bench.studies.reliability import kills, runs
from tests.commands.pageless import pageless

FLAGS = ["--steps", "600", *kills.FLAGS]


def test_two_kills_change_no_bit(tmp_path: Path) -> None:
    flow = runs.make_flow(tmp_path / "flow.h5")
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    process = runs.start(pageless(runs.command(flow, whole, FLAGS)))
    _, err = process.communicate()
    assert process.returncode == 0, err
    newest = 0
    for _ in range(2):
        process = runs.start(pageless(runs.command(flow, killed, FLAGS)))
        before = set(killed.glob("checkpoint/step-*.safetensors"))
        while (
            process.poll() is None and set(killed.glob("checkpoint/step-*.safetensors")) <= before
        ):
            time.sleep(0.01)
        runs.end(process)
        process.communicate()
        reason, newest = kills.survived(killed, newest)
        assert reason == ""
    process = runs.start(pageless(runs.command(flow, killed, FLAGS)))
    _, err = process.communicate()
    assert process.returncode == 0, err
    assert runs.difference(whole, killed) is None
