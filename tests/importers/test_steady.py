"""Steady flows and periodic sides from measurement files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.data import read_flow
from granpinn.importers import DataFileError, read
from tests.importers.test_convert import CAMERA, MATERIAL, run
from tests.importers.test_pivlab_text import export
from tests.importers.test_tracks import motion, write_csv


def test_one_frame_of_a_steady_chute(tmp_path: Path, capsys: Any) -> None:
    """One averaged field is enough if the flow is said to be steady; its sides may be periodic."""
    file, out = export(tmp_path / "mean.txt", 0), tmp_path / "flow.h5"
    more = ["--steady", "--period-x", "2 m"]
    assert run(file, "--out", out, *CAMERA, *MATERIAL, *more) == 0
    flow = read_flow(out)
    assert (flow.t.size, flow.steady, flow.stated("period_x")) == (1, True, 2.0)
    assert run(file, "--out", tmp_path / "other.h5", *CAMERA, *MATERIAL) == 2
    assert "at least two frames (or one and --steady) must hold" in capsys.readouterr().err


def test_tracks_of_one_time(tmp_path: Path) -> None:
    """The frame of a steady flow."""
    columns = motion(0.02, tracks=80)
    write_csv(tmp_path / "tracks.csv", columns)
    settings = {"scale": "0.5 mm/px", "frame_rate": "500 Hz", "grain_diameter": "0.5 mm"}
    settings |= {
        "density": "1500 kg/m^3",
        "grain_density": "2500 kg/m^3",
        "surface": "none",
        "length_unit": "px",
        "velocity_unit": "px/frame",
        "flip_y": "yes",
    }
    flow = read(str(tmp_path / "tracks.csv"), frames="5:6", steady=True, **settings)
    assert flow.particles is not None
    assert np.unique(flow.particles.t).size == flow.t.size == 1
    assert flow.steady
    with pytest.raises(DataFileError, match="at least two frames"):
        read(str(tmp_path / "tracks.csv"), frames="5:6", **settings)
