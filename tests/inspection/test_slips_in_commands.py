"""What the commands say of a slip of calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.commands import convert, inspect
from granpinn.config import Config
from granpinn.data import Flow, FlowFileError, FlowFileWarning, write_flow
from granpinn.fit.case import pose
from granpinn.importers import Settings
from granpinn.importers import convert as converted
from tests.flows import make_flow
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


@pytest.mark.parametrize(("rate", "text"), [(1e-3, r"0\.019\d px"), (10.0, r"19\d px")])
def test_displacements_that_no_picture_shows(rate: float, text: str) -> None:
    arrays = vectors(falling(noise=0.01))
    arrays |= {name: arrays[name] * rate for name in ("u", "v")}
    settings = Settings(
        scale="1 mm/px",
        frame_rate="100 Hz",
        grain_diameter="5 mm",
        grain_density="2500 kg/m^3",
        solid_fraction=0.6,
    )
    with pytest.warns(FlowFileWarning, match=f"the fastest vectors move by {text}"):
        converted(arrays, settings)


def test_inspect_leads_with_what_is_improbable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "flow.h5"
    write_flow(make_flow(grain_density=15_000.0), path)
    assert inspect.main([str(path)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("improbable: the grains fill 0.1 of the space")
    assert "- A law from these data is not to be used, as they are improbable" in printed
    assert "Expected of a training" not in printed
    assert "next: mend the flow file" in printed


def test_training_keeps_what_is_improbable() -> None:
    flow = falling(1.5)
    with pytest.warns(FlowFileWarning, match="falls with 1.5 times the gravity"):
        case = pose(flow, Config(level="V0"))
    assert len(case.slips) == 1
    with pytest.raises(FlowFileError, match="falls with 2 times the gravity"):
        pose(falling(2.0), Config(level="V0"))
