"""What the commands say of a slip of calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.commands import convert
from granpinn.data import Flow
from tests.inspection.falling import falling

GRAINS = ("--grain-diameter", "5 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")


def vectors(flow: Flow) -> dict[str, Any]:
    """The vectors as arrays of a file, in pixels of 1 mm and frames of 10 ms."""
    arrays = {"t": np.arange(flow.t.size), "x": flow.x * 1e3, "y": flow.y * 1e3}
    arrays |= {name: getattr(flow, name) * 10.0 for name in ("u", "v")}
    units = {"length_unit": "px", "velocity_unit": "px/frame", "time_unit": "frame"}
    return arrays | units | {"mask": flow.c < 1, "y_down": False}


@pytest.mark.parametrize(
    ("scale", "flags", "code"), [(1.0, (), 0), (10.0, (), 2), (10.0, ("--force",), 0)]
)
def test_convert_refuses_what_is_impossible(
    scale: float, flags: tuple[str, ...], code: int, tmp_path: Path, capsys: Any
) -> None:
    data, out = tmp_path / "vectors.npz", tmp_path / "flow.h5"
    np.savez(data, **vectors(falling(noise=0.01)))
    calibration = ("--scale", f"{scale} mm/px", "--frame-rate", "100 Hz", "--surface", "none")
    assert convert.main([str(data), "--out", str(out), *calibration, *GRAINS, *flags]) == code
    printed, warned = capsys.readouterr()
    assert out.exists() == (code == 0)
    verb = "train" if scale == 1 else "inspect"
    assert (f"next: granpinn {verb} {out}" in printed) == (code == 0)
    assert ("give --force to write it" in warned) == (code == 2)
    found = [line for line in warned.splitlines() if "times the gravity" in line]
    assert len(found) == (scale != 1)
    for line in found:
        assert line.startswith("warning: impossible: the top of the grains falls with 10 times")
