"""The command from files to a flow file, and its errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn import Config, identify
from granpinn.commands.convert import main
from granpinn.config import Network
from granpinn.data import FlowFileWarning, read_flow
from granpinn.importers import DataFileError, Validity, read, read_vectors
from tests.importers import scene
from tests.importers.test_other_piv import openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_tracks import motion, write_csv

MATERIAL = ["--grain-diameter", "2 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6"]

CAMERA = ["--scale", "0.5 mm/px", "--frame-rate", "500 Hz"]


@pytest.fixture
def series(tmp_path: Path) -> list[str]:
    """The scene as PIVlab exports it, one file per frame."""
    return [str(export(tmp_path / f"PIVlab_{k + 1}.txt", k)) for k in range(scene.FRAMES)]


def run(*arguments: Any) -> int:
    return main([str(argument) for argument in arguments])


def test_pivlab_series(tmp_path: Path, series: list[str], capsys: Any) -> None:
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, *CAMERA, *MATERIAL, "--tilt", "-1.2 deg") == 0
    text = capsys.readouterr().out
    assert "PIVlab text, 3 files: 3 frames, 7 x 9 vectors px/frame" in text
    assert f"next: granpinn train {out} --out run" in text
    flow = read_flow(out)
    assert (flow.length_unit, flow.time_unit, flow.density_unit) == ("m", "s", "kg/m^3")
    assert (flow.density, flow.grain_density, flow.grain_diameter) == (1500, 2500, 0.002)
    assert flow.gravity[0] < 0
    np.testing.assert_allclose(flow.t, (0.5 + np.arange(3)) / 500)
    np.testing.assert_allclose(flow.x, 0.5e-3 * (scene.X - scene.X[0]))
    np.testing.assert_allclose(flow.y, 0.5e-3 * (scene.Y_DOWN - scene.Y_DOWN[0]))
    codes = scene.codes()[:, ::-1]
    np.testing.assert_array_equal(flow.c, codes != Validity.MASKED)
    u, v = (a[:, ::-1] * 0.5e-3 * 500 for a in scene.velocity())
    valid = codes == Validity.VALID
    np.testing.assert_allclose(flow.u[valid], u[valid], rtol=1e-6)
    np.testing.assert_allclose(flow.v[valid], -v[valid], rtol=1e-6)
    assert np.isnan(flow.u[~valid]).all()
    assert flow.surface is not None
    assert flow.attributes["scale"] == "0.5 mm/px"
    assert flow.attributes["source"] == "PIVlab text"


def test_interpolated_vectors_are_used_only_if_asked_for(tmp_path: Path, series: list[str]) -> None:
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, *CAMERA, *MATERIAL, "--keep-interpolated") == 0
    used = np.isfinite(read_flow(out).u)
    codes = scene.codes()[:, ::-1]
    np.testing.assert_array_equal(used, np.isin(codes, (Validity.VALID, Validity.INTERPOLATED)))


def test_times_from_names(tmp_path: Path) -> None:
    files = [export(tmp_path / f"run2_t{t}.txt", k) for k, t in enumerate(("0.10", "0.9", "1.5"))]
    settings = {"scale": "1 mm/px", "pulse_delay": "1 ms", "time_unit": "s"}
    material = {"grain_diameter": "2 mm", "density": "1500 kg/m^3", "grain_density": "2500 kg/m^3"}
    flow = read(files, times="name", **settings, **material)
    np.testing.assert_allclose(flow.t, [0.1, 0.9, 1.5])
    u = scene.velocity()[0][:, ::-1]
    np.testing.assert_allclose(flow.u[flow.valid], u[flow.valid], rtol=1e-6)
    signed = [export(tmp_path / f"s_{t}.txt", k) for k, t in enumerate(("t-0.5", "t0.0", "t0.5"))]
    with pytest.raises(DataFileError, match="'-' before all numbers or before none"):
        read(signed, times="name", **settings, **material)
    same = str(scene.write_lines(tmp_path / "same.txt", ["t [ms]", "1", "2", "2"]))
    with pytest.raises(DataFileError, match="time_unit must be ms, which the first line of"):
        read(files, times=same, **settings, **material)
    with pytest.raises(DataFileError, match="another time for every frame of 3, got 3"):
        read(files, times=same, **settings | {"time_unit": None}, **material)


def test_tracks_end_in_a_particle_file_that_can_be_trained_on(tmp_path: Path) -> None:
    """From a table of positions in pixels to friction coefficients, without a grid."""
    columns = motion(0.02, tracks=150)
    write_csv(tmp_path / "tracks.csv", columns | {"mass": columns["x"], "ecc": columns["x"]})
    (tmp_path / "line.csv").write_text(
        "frame,x,y\n" + "\n".join(f"{k},{x},{x}" for k in range(12) for x in range(0, 500, 25))
    )
    out = tmp_path / "flow.h5"
    line = ["--surface", tmp_path / "line.csv"]
    assert run(tmp_path / "tracks.csv", "--out", out, *CAMERA, *MATERIAL, *line) == 0
    flow = read_flow(out)
    assert flow.particles is not None
    assert flow.particles.t.size == 150 * 12
    assert flow.particles.sigma_u is not None
    assert flow.particles.v.mean() < 0  # y was down
    small = Config(steps=2, device="cpu", network=Network(widths=(8,)))
    result = identify(out, small, run_dir=tmp_path / "run")
    assert result.data.n_points == 150 * 11  # without the frame at t = 0
    assert result.data.n_surface > 100


def test_the_window_is_kept_in_meters(series: list[str]) -> None:
    given = {"scale": "0.5 mm/px", "frame_rate": "500 Hz", "solid_fraction": 0.6}
    given |= {"grain_diameter": "0.8 mm", "grain_density": "2500 kg/m^3"}
    flow = read(series, window="16 px", **given)
    assert flow.attributes["interrogation_window"] == pytest.approx(16 * 0.5e-3)
    with pytest.warns(FlowFileWarning, match="windows are 4 spacings wide, and averaging mends 2"):
        read(series, window="32 px", **given)
    assert "interrogation_window" not in read(series, **given).attributes
    for wrong in ("9 m", "0 px", "32 s"):
        with pytest.raises(DataFileError, match="window"):
            read(series, window=wrong, **given)


def test_everything_that_is_missing_is_named_at_once(series: list[str], capsys: Any) -> None:
    assert run(*series, "--out", "flow.h5") == 2
    text = capsys.readouterr().err
    for name in ("--scale", "--frame-rate", "--grain-diameter", "--grain-density"):
        assert name in text
    assert "--solid-fraction" in text
    assert text.count("\n") == 1


def test_units_that_the_files_do_not_say(tmp_path: Path, capsys: Any) -> None:
    files = [openpiv(tmp_path / f"a{k}.txt", k) for k in range(3)]
    assert run(*files, "--out", tmp_path / "f.h5", *CAMERA, *MATERIAL) == 2
    text = capsys.readouterr().err
    assert "--length-unit (the files do not say the unit of x and y)" in text
    assert "--velocity-unit (the files do not say the unit of u and v)" in text
    units = ["--length-unit", "px", "--velocity-unit", "px/frame"]
    assert run(*files, "--out", tmp_path / "f.h5", *CAMERA, *MATERIAL, *units) == 0


WRONG = {
    "no such file": (["nothing.txt", "--out", "f.h5"], "nothing.txt does not exist"),
    "no match": (["nothing_*.txt", "--out", "f.h5"], "no file matches"),
    "no out": (["a.txt"], "the following arguments are required: --out"),
    "flag": (["a.txt", "--out", "f.h5", "--scael", "1"], "unrecognized arguments"),
    "folder": (["a.txt", "--out", "nowhere/f.h5"], "must lie in an existing folder"),
    "format": (["FILE", "--out", "f.h5", "--format", "tiff"], "--format must be auto or one of"),
    "wrong format": (
        ["FILE", "--out", "f.h5", "--format", "openpiv"],
        "FILE must have the columns",
    ),
    "scale": (
        ["FILE", "--out", "f.h5", "--scale", "2 mm", *CAMERA[2:], *MATERIAL],
        "--scale must be a positive length per pixel such as '0.12 mm/px', got '2 mm'",
    ),
    "diameter": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL[2:], "--grain-diameter", "0.8"],
        "--grain-diameter must be in a unit of length, such as '0.8 mm', got '0.8'",
    ),
    "negative": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL[2:], "--grain-diameter", "-1 mm"],
        "--grain-diameter must be positive",
    ),
    "fraction": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL[:4], "--solid-fraction", "60"],
        "--solid-fraction must be above 0 and at most 1, got 60",
    ),
    "three densities": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL, "--density", "1000 kg/m^3"],
        "--density must be grain density times solid fraction, 1500, got 1000",
    ),
    "frames": (["FILE", "--out", "f.h5", "--frames", "a:b"], "--frames must be FIRST:LAST:STEP"),
    "one frame": (
        ["FILE", "--out", "f.h5", "--frames", "0:1", *CAMERA, *MATERIAL],
        "at least two frames (or one",
    ),
    "times": (["FILE", "--out", "f.h5", "--times", "FILE"], "must have the columns t, got"),
    "origin": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL, "--origin", "3"],
        "--origin must be two numbers x,y, got '3'",
    ),
    "flip": (
        ["FILE", "--out", "f.h5", "--flip-y", "maybe"],
        "--flip-y must be one of auto",
    ),
    "gravity": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL, "--gravity", "-9.81 m/s^2"],
        "--gravity must be positive",
    ),
    "over the data": (["FILE", "--out", "FILE"], "--out must be another file than the data"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_input_is_one_sentence(
    tmp_path: Path, arguments: list[str], message: str, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    export(tmp_path / "FILE", 0)
    # 1: a file cannot be written.
    assert run(*arguments) == (1 if "existing folder" in message else 2)
    text = capsys.readouterr().err
    assert any(part in text for part in message.split("|"))
    assert text.startswith("granpinn.convert: ")
    assert text.count("\n") == 1
    assert not (tmp_path / "f.h5").exists()


def test_unknown_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("hello world\n")
    with pytest.raises(DataFileError, match="is of no known format: name it with format"):
        read_vectors(tmp_path / "a.txt")
    (tmp_path / "b.txt").write_text("")
    with pytest.raises(DataFileError, match="b.txt is empty, expected vectors"):
        read_vectors(tmp_path / "b.txt")
    export(tmp_path / "c.csv")
    with pytest.raises(DataFileError, match="holds files of several kinds"):
        read_vectors(tmp_path)


def test_a_flow_file_needs_no_conversion(tmp_path: Path, series: list[str], capsys: Any) -> None:
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, *CAMERA, *MATERIAL) == 0
    assert run(out, "--out", tmp_path / "other.h5") == 2
    assert "is a flow file already: python -m granpinn.train" in capsys.readouterr().err
