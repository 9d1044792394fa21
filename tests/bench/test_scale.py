"""The benchmark of large flows: its flow, its peaks and its claim."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from bench import scale
from bench.scale import EVERY, _compared, peak, write_flow_file
from granpinn.data import read_flow
from granpinn.inspection import quick


def test_the_flow_is_sound(tmp_path: Path) -> None:
    write_flow_file(tmp_path / "flow.h5", 12, 64)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        flow = read_flow(tmp_path / "flow.h5")
    assert quick(flow).slips == ()
    assert flow.valid.mean() == 0.5


def test_the_flow_keeps_its_volume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale, "NOISE", 0.0)
    write_flow_file(tmp_path / "flow.h5", 3, 128)
    flow = read_flow(tmp_path / "flow.h5")
    u, v = (a[:, :64].astype(np.float64) for a in (flow.u, flow.v))
    u_x, v_y = np.gradient(u, flow.x, axis=2), np.gradient(v, flow.y[:64], axis=1)
    inside = np.s_[:, 2:-2, 2:-2]
    assert np.abs(u_x).max() > 0.5
    assert np.abs((u_x + v_y)[inside]).max() < 0.01 * np.abs(u_x).max()


def test_the_peak_is_that_of_the_memory_in_use() -> None:
    with peak() as small:
        time.sleep(4 * EVERY)
    with peak() as large:
        held = np.ones(300 * 2**17)
        time.sleep(8 * EVERY)
        assert held[0] == 1
    assert 0.25 < large[0] - small[0] < 0.4


def test_the_claim_needs_memory_and_speed() -> None:
    small = {"steps_per_s": 100.0, "host_gb": 1.0, "device_gb": None}
    assert _compared(small, small | {"steps_per_s": 90.0})["claim_holds"]
    for change in ({"steps_per_s": 89.0}, {"host_gb": 4.1}, {"device_gb": 8.1}):
        assert not _compared(small, small | change)["claim_holds"]
    assert _compared(small, small | {"error": "killed"}) == {}
