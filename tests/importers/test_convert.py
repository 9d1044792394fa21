"""The command from files to a flow file, and its errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn import Config, identify
from granpinn.command.conversion import parse
from granpinn.commands.convert import main, parser
from granpinn.config import Network
from granpinn.data import FlowFileWarning, read_flow
from granpinn.importers import DataFileError, Settings, Validity, read, read_vectors
from tests.importers import scene
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk
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
    assert "PIVlab text, any header, 3 files: 3 frames, 7 x 9 vectors px/frame" in text
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
    assert flow.attributes["source"] == "PIVlab text, any header"


def test_interpolated_vectors_are_used_only_if_asked_for(tmp_path: Path, series: list[str]) -> None:
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, *CAMERA, *MATERIAL, "--keep-interpolated") == 0
    used = np.isfinite(read_flow(out).u)
    codes = scene.codes()[:, ::-1]
    np.testing.assert_array_equal(used, np.isin(codes, (Validity.VALID, Validity.INTERPOLATED)))


def test_frames_times_and_delay(tmp_path: Path, series: list[str]) -> None:
    """Pairs 1 ms apart, taken at times of a file of its own; the first pair is left out."""
    (tmp_path / "times.txt").write_text("t [ms]\n10\n25\n60\n")
    more = ["--times", tmp_path / "times.txt", "--pulse-delay", "1 ms", "--frames", "1:"]
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, "--scale", "0.5 mm/px", *more, *MATERIAL) == 0
    flow = read_flow(out)
    np.testing.assert_allclose(flow.t, [0.025, 0.06])
    u = scene.velocity()[0][1:, ::-1]
    np.testing.assert_allclose(flow.u[flow.valid], 0.5 * u[flow.valid], rtol=1e-6)


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


def test_dimensionless_simulation(tmp_path: Path) -> None:
    fields = read_vectors([export(tmp_path / f"a{k}.txt", k, header=False) for k in range(3)])
    flow = read(fields, dimensionless=True, grain_diameter="0.1", frame_rate="4", start="0.5")
    np.testing.assert_allclose(flow.t, [0.5, 0.75, 1.0])
    assert (flow.length_unit, flow.gravity, flow.density) == ("1", (0.0, -1.0), 1.0)
    assert flow.density_unit is None
    with pytest.raises(DataFileError, match="dimensionless contradicts the files"):
        read(export(tmp_path / "a0.txt"), dimensionless=True, grain_diameter="1")


def test_side_walls_and_sigma(tmp_path: Path, series: list[str], capsys: Any) -> None:
    out = tmp_path / "flow.h5"
    more = ["--wall-gap", "20 mm", "--sigma", "0.1 px/frame", "--note", "glass beads"]
    assert run(*series, "--out", out, *CAMERA, *MATERIAL, *more) == 0
    assert "side walls: the grains are" in capsys.readouterr().out
    flow = read_flow(out)
    assert flow.attributes["wall_gap"] == 0.02
    assert flow.attributes["note"] == "glass beads"
    assert flow.sigma_u == pytest.approx(0.1 * 0.5e-3 * 500)


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
    files = [export(tmp_path / f"a{k}.txt", k, header=False) for k in range(3)]
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
    "wrong format": (["FILE", "--out", "f.h5", "--format", "openpiv"], "FILE, line 1: expected n"),
    "scale": (
        ["FILE", "--out", "f.h5", "--scale", "2 mm", *CAMERA[2:], *MATERIAL],
        "--scale must be a positive length per pixel such as '0.12 mm/px', got '2 mm'",
    ),
    "diameter": (
        ["FILE", "--out", "f.h5", *CAMERA, *MATERIAL[2:], "--grain-diameter", "0.8"],
        "--grain-diameter must be a length with its unit, such as '0.8 mm', got '0.8'",
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
        ["FILE", "--out", "f.h5", "--frames", "0:1"],
        "leave at least two frames (or one",
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
    assert run(*arguments) == 2
    text = capsys.readouterr().err
    assert any(part in text for part in message.split("|"))
    assert text.startswith("granpinn.convert: ")
    assert text.count("\n") == 1
    assert not (tmp_path / "f.h5").exists()


def test_settings_in_python_are_checked() -> None:
    with pytest.raises(DataFileError, match="unknown setting scael: did you mean scale"):
        read({}, scael="1")
    with pytest.raises(DataFileError, match="scale must be text such as"):
        Settings(scale=0.12)  # type: ignore[arg-type]
    with pytest.raises(DataFileError, match="Settings.track_window must be a whole number"):
        Settings(track_window=2.5)  # type: ignore[arg-type]


def test_help_teaches() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "granpinn.convert", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    for word in ("examples:", "--scale", "plumb line", "pivlab-mat", "docs/guides/importing.md"):
        assert word in done.stdout


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


def test_basilisk_series_keeps_its_pressure(tmp_path: Path) -> None:
    """Times from the names; u, v, c and p of a simulation without units arrive unchanged."""
    for k, t in enumerate(("0.10", "0.20", "1.00")):
        basilisk(tmp_path / f"out-{t}.txt", k)
    names = ["--dimensionless", "--times", "name", "--grain-diameter", "0.5", "--gravity", "2"]
    out = tmp_path / "flow.h5"
    flow = read(str(tmp_path / "out-*.txt"), **_settings(names))
    assert run(tmp_path / "out-0.10.txt", tmp_path / "out-1.00.txt", "--out", out, *names) == 0
    np.testing.assert_allclose(flow.t, [0.1, 0.2, 1.0])
    assert flow.gravity == (0.0, -2.0)
    assert flow.p is not None
    assert (flow.p[flow.c == 1] == 2.5).all()
    np.testing.assert_allclose(read_flow(out).t, [0.1, 1.0])
    physical = {**PLAIN, "length_unit": "m", "time_unit": "s", "velocity_unit": "m/s"}
    assert read(str(tmp_path / "out-*.txt"), times="name", surface="none", **physical).p is None


PLAIN = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}


def _settings(flags: list[str]) -> dict[str, Any]:
    """The settings of a command line."""
    return parse(parser(), ["a", "--out", "b.h5", *flags])[2]


def test_files_that_hold_the_same_time(tmp_path: Path) -> None:
    """Some programs write no true times: they can be counted, or given."""
    vectors = {"y": scene.Y_DOWN, "x": scene.X, "u": 1 + scene.velocity()[0][:1]}
    units = {"length_unit": "mm", "time_unit": "s", "velocity_unit": "mm/s"}
    for k in range(3):
        np.savez(tmp_path / f"a{k}.npz", t=[7.5], v=vectors["u"], **vectors, **units)
    files = str(tmp_path / "a*.npz")
    with pytest.raises(DataFileError, match="times that increase with their names, got 7.5 and 7"):
        read(files, surface="none", **PLAIN)
    counted = read(files, surface="none", time_unit="frame", frame_rate="10 Hz", **PLAIN)
    np.testing.assert_allclose(counted.t, [0.05, 0.15, 0.25])
    (tmp_path / "times.txt").write_text("t [ms]\n1\n2\n4\n")
    given = read(files, surface="none", times=str(tmp_path / "times.txt"), **PLAIN)
    np.testing.assert_allclose(given.t, [1e-3, 2e-3, 4e-3])


def test_a_flow_file_needs_no_conversion(tmp_path: Path, series: list[str], capsys: Any) -> None:
    out = tmp_path / "flow.h5"
    assert run(*series, "--out", out, *CAMERA, *MATERIAL) == 0
    assert run(out, "--out", tmp_path / "other.h5") == 2
    assert "is a flow file already: python -m granpinn.train" in capsys.readouterr().err
