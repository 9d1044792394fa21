"""A quantity that is stated twice must agree, or the conversion stops with both statements."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.data import FlowFileWarning
from granpinn.importers import DataFileError, read
from tests.importers import scene

MATERIAL = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}
Y, X = np.meshgrid(16.0 + 16 * np.arange(6), 16.0 + 16 * np.arange(8), indexing="ij")


def pivlab(
    folder: Path,
    pairs: list[tuple[int, int]],
    *,
    xy: float = 1.0,
    uv: float | list[float] = 1.0,
) -> list[Path]:
    """Files of pairs of images, whose grains move by 1 px along x from image to image."""
    factors = [uv] * len(pairs) if isinstance(uv, float) else uv
    unit = ("px", "px/frame") if xy == 1 else ("m", "m/s")
    files = []
    for k, ((a, b), factor) in enumerate(zip(pairs, factors, strict=True)):
        head = (
            f"FRAME: {k + 1}, filenames: A: s {a:03}.tif & B: s {b:03}.tif, conversion factor xy "
            f"(px -> m): {xy}, conversion factor uv (px/frame -> m/s): {factor}"
        )
        names = f"x [{unit[0]}],y [{unit[0]}],u [{unit[1]}],v [{unit[1]}],Vector type [-]"
        rows = [
            f"{xy * x:.9g},{xy * y:.9g},{(b - a) * factor},{0.01 * (b - a) * factor * y},1"
            for x, y in zip(X.T.ravel(), Y.T.ravel(), strict=True)
        ]
        files.append(scene.write_lines(folder / f"p{k}.txt", ["PIVlab, ASCII", head, names, *rows]))
    return files


FILM = [(k, k + 1) for k in range(1, 5)]


def flow_of(source: Any, **settings: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FlowFileWarning)
        return read(source, surface="none", **MATERIAL, **settings)


CONTRADICTIONS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "1 s and 500 Hz": (
        {"xy": 1e-4, "uv": 1e-4},
        {"frame_rate": "500 Hz"},
        r"header says 1 s, frame_rate \(you\) says 2 ms: "
        'give pulse_delay "1 s" for double frames',
    ),
    "2 ms and 50 Hz": (
        {"xy": 1e-4, "uv": 0.05},
        {"frame_rate": "50 Hz"},
        r"header says 2 ms, frame_rate \(you\) says 20 ms",
    ),
    "two delays": (
        {"xy": 1e-4, "uv": 0.05},
        {"frame_rate": "500 Hz", "pulse_delay": "1 ms"},
        r"header says 2 ms, pulse_delay \(you\) says 1 ms",
    ),
    "two scales": (
        {"xy": 1e-4, "uv": 0.05},
        {"frame_rate": "500 Hz", "scale": "0.12 mm/px"},
        "the header says 100 µm/pixel, scale says 0.12 mm/px: leave scale out",
    ),
    "factors change": (
        {"xy": 1e-4, "uv": [0.05, 0.05, 0.06, 0.05]},
        {"frame_rate": "500 Hz"},
        "p2.txt must have the calibration calxy 0.0001, caluv 0.05 of .*p0.txt, got .* caluv 0.06",
    ),
    "two units": (
        {"xy": 1e-4, "uv": 0.05},
        {"frame_rate": "500 Hz", "length_unit": "mm"},
        "the length unit is stated twice: the file says m, length_unit says mm",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_contradictions_stop_with_both_values(tmp_path: Path, name: str) -> None:
    written, settings, message = CONTRADICTIONS[name]
    files = pivlab(tmp_path, FILM, **written)
    with pytest.raises(DataFileError, match=message):
        flow_of(files, **settings)


SETTLED: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    "equal": ({"xy": 1e-4, "uv": 0.05}, {"frame_rate": "500 Hz", "scale": "0.1 mm/px"}, 0.05),
    "within 2 %": ({"xy": 1e-4, "uv": 0.05}, {"frame_rate": "495 Hz"}, 0.05),
    "double frames": (
        {"xy": 1e-4, "uv": 0.05},
        {"frame_rate": "50 Hz", "pulse_delay": "2 ms"},
        0.05,
    ),
    "never set": (
        {"xy": 1e-4, "uv": 1e-4},
        {"frame_rate": "500 Hz", "velocity_unit": "m/frame"},
        0.05,
    ),
    "not calibrated": ({}, {"frame_rate": "500 Hz", "scale": "0.1 mm/px"}, 0.05),
}


@pytest.mark.parametrize("name", SETTLED)
def test_what_agrees_or_is_settled_is_read(tmp_path: Path, name: str) -> None:
    written, settings, u = SETTLED[name]
    flow = flow_of(pivlab(tmp_path, FILM, **written), **settings)
    np.testing.assert_allclose(flow.u, u, rtol=1e-6)
    np.testing.assert_allclose(np.diff(flow.x), 16e-4, rtol=1e-6)


def arrays(**units: Any) -> dict[str, Any]:
    shape = (4, *X.shape)
    vectors = {"t": 0.01 * np.arange(4), "y": Y[:, 0], "x": X[0]}
    vectors |= {"u": np.full(shape, 2.0), "v": np.broadcast_to(Y, shape), "y_down": False}
    return vectors | {"length_unit": "mm", "time_unit": "s", "velocity_unit": "mm/s"} | units


def test_other_formats_follow_the_same_rule() -> None:
    with pytest.raises(DataFileError, match="the file says 10 ms, frame_rate says 2 ms"):
        flow_of(arrays(), frame_rate="500 Hz")
    flow_of(arrays(), frame_rate="100 Hz")
    with pytest.raises(DataFileError, match="velocity unit is stated twice"):
        flow_of(arrays(), velocity_unit="m/s")
