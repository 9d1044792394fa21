"""The model error of kinds of flows from scored scenes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.studies.coverage.calibrate import text_of
from bench.studies.grains import model_error
from bench.studies.grains.materials import I0
from granpinn.uncertainty import calibration

RANGE = [0.01, 0.185]
NUMBERS = np.array([0.01, 0.03, 0.055, 0.1, 0.185])


def score(kind: str, a: float, b: float, **changes: Any) -> dict[str, Any]:
    x, ends = NUMBERS / (NUMBERS + I0), np.array(RANGE) / (np.array(RANGE) + I0)
    errors = 100 * (a + b * (2 * x - ends.sum()) / np.ptp(ends))
    own = {f"{i:g}": float(e) for i, e in zip(NUMBERS, errors, strict=True)}
    head = {"scene": "chute", "material": 0.4, "kind": kind, "level": "V1", "failure": None}
    head["I_range"] = RANGE
    return head | {"error_percent_own": own} | changes


def test_level_and_tilt_are_those_of_the_errors() -> None:
    assert model_error.level_and_tilt(score("layer", 0.02, -0.05)) == pytest.approx((0.02, -0.05))
    one = score("layer", 0.0, 0.0, error_percent_own={}, mean={"error_percent": -1.5})
    assert model_error.level_and_tilt(one) == (-0.015, None)
    with pytest.raises(ValueError, match="chute has no error"):
        model_error.level_and_tilt(score("layer", 0.0, 0.0, error_percent_own={}))


def test_every_kind_has_its_own_entry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scores = [
        score("layer", 0.03, 0.04),
        score("layer", -0.04, 0.03, material=0.2),
        score("layer", 9.0, 9.0, failure="diverged"),
        score("layer", 9.0, 9.0, level="V0"),
        score("carried", 9.0, 9.0),
        score("steady_layer", 0, 0, error_percent_own={}, mean={"error_percent": 2.0}),
    ]
    (tmp_path / "grains.json").write_text(json.dumps({"date": "2026-01-01", "scores": scores}))
    table = tmp_path / "table.json"
    empty = dataclasses.replace(calibration.load(), model_error={})
    table.write_text(text_of(empty))
    command = ["x", str(tmp_path / "grains.json"), "--write", str(table)]
    monkeypatch.setattr("sys.argv", command)
    assert model_error.main() == 0
    calibration.load.cache_clear()
    found = calibration.load(table).model_error
    assert found.keys() == {"layer", "steady_layer"}
    layer, steady = found["layer"], found["steady_layer"]
    assert (layer.level, layer.tilt) == pytest.approx((np.hypot(3, 4) / 100 / 2**0.5,) * 2)
    assert layer.flows == 2
    assert layer.provenance == "bench.studies.grains.run of 2026-01-01: chute 0.2, chute 0.4"
    assert (steady.level, steady.tilt, steady.flows) == (0.02, 0.02, 1)
    scores[0]["kind"] = "silo"
    (tmp_path / "grains.json").write_text(json.dumps({"date": "2026-01-01", "scores": scores}))
    assert model_error.main() == 1
    assert "model_error.silo" in capsys.readouterr().err
