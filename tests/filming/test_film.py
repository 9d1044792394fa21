"""A film of a layer that is sheared: vectors, surface, release, faults, page and command."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from granpinn.data import read_flow
from granpinn.filming import FilmSettings
from granpinn.filming.frames import ImageSequence
from granpinn.filming.measurement import Measured, measure
from granpinn.filming.segmentation import segmented
from granpinn.filming.tracking import follow
from granpinn.importers import DataFileError

ROWS, COLUMNS, TOP = 120, 200, 40  # px; the grains lie below row TOP
GRAIN = 6.0  # px
STILL = 5  # frames before the release
LAB: dict[str, Any] = {
    **{"scale": "0.1 mm/px", "frame_rate": "300 Hz", "tilt": "30 deg", "origin": f"0,{ROWS - 1}"},
    **{"grain_diameter": "0.6 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6},
}


def speed(y: Any, k: float) -> Any:
    """Of the layer to the right, px/frame: faster at the top, and with time."""
    return 0.03 * (ROWS - y) * min(max(k - STILL, 0) / 4, 1.0)


NOISE = np.random.default_rng(5).standard_normal((ROWS, 3 * COLUMNS))
TEXTURE = gaussian_filter(NOISE, 1.5, mode="wrap")


def drawn(k: int, rows: Any, columns: Any, inside: Any) -> Any:
    """Frame k of the texture at these places, where there are grains, and noise [ROWS, COLUMNS]."""
    grains = map_coordinates(TEXTURE, [rows, columns], order=3, mode="grid-wrap")
    picture = np.where(inside, 120 + 50 * grains / TEXTURE.std(), 10.0)
    noisy = picture + 2 * np.random.default_rng(k).standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def frame(k: int) -> Any:
    """Frame k: a texture that moves along x by the integral of `speed`."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    moved = sum(speed(rows + 0.0, i + 0.5) for i in range(k))
    return drawn(k, rows, columns - moved, rows >= TOP)


def falling(k: int, tilt: float) -> Any:
    """Frame k of a layer that falls onto a floor and spreads, in a picture turned by `tilt`."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    x, y = columns - COLUMNS / 2, 0.8 * ROWS - rows
    x, y = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
    grown = np.exp(0.02 * max(k - STILL, 0))
    inside = (y > 0) & (y * grown < 40) & (np.abs(x) < 50 * grown)
    return drawn(k, y * grown, x / grown, inside)


SHOT = [frame(k) for k in range(24)]
ON_FLOOR = [np.pad(p, ((0, 30), (0, 0)), constant_values=10) for p in SHOT]
RANDOM = np.random.default_rng(1)


@pytest.fixture(autouse=True)
def in_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def save(pictures: list[Any]) -> None:
    """Writes the files; None is a file that is no picture."""
    for k, picture in enumerate(pictures):
        code = b"" if picture is None else cv2.imencode(".png", picture)[1].tobytes()
        Path(f"f_{k:03d}.png").write_bytes(code or b"\x89PNG no picture")


def shoot(pictures: list[Any] = SHOT, **more: Any) -> Measured:
    save(pictures)
    return measure("f_*.png", FilmSettings(**LAB | more))


def test_velocity_surface_and_release() -> None:
    """The chain on a known motion; errors are held to a few of the stated deviations."""
    found = shoot()
    number = [*found.pictures][-1]
    good = found.vectors[found.vectors.good & (found.vectors.t == number)]
    error = good.u - speed(good.y, number)
    assert len(good) > 200
    assert np.sqrt(np.mean(error**2)) < 0.05 * speed(TOP, number)
    assert np.mean(np.abs(good.v) < 3 * good.sd) > 0.9
    assert found.released == pytest.approx(STILL, abs=1.5)
    assert found.line is not None
    assert abs(np.median(found.line.y) - (ROWS - TOP)) < GRAIN / 2
    assert found.said[0].startswith("film: 24 frames")  # faults would be before it
    flow = found.flow
    assert flow.particles is not None
    assert flow.particles.sigma_u is not None
    assert flow.particles.u.max() == pytest.approx(speed(TOP, 20) * 1e-4 * 300, rel=0.1)
    assert flow.stated("surface_sd") == pytest.approx(0.1 * 0.6e-3)
    assert flow.t[0] > 0
    assert flow.surface is not None
    below = np.median(flow.surface.y) - flow.particles.y.max()
    assert 0.6 * GRAIN < below * 1e4 < 1.5 * GRAIN  # a window of 1.5 grains ends at the surface


@pytest.mark.parametrize("degrees", [-12.0, 20.0])
def test_tilt_of_a_level_floor(degrees: float) -> None:
    pictures = [falling(k, np.radians(degrees)) for k in range(24)]
    x, y = shoot(pictures, tilt="auto", frame_rate="900 Hz").flow.gravity
    assert np.degrees(np.arctan2(x, -y)) == pytest.approx(degrees, abs=2)  # on 20 grains


def test_no_surface_is_seen_at_a_mask() -> None:
    cv2.imwrite("m.png", 255 * np.tile(np.arange(COLUMNS) < 120, (ROWS, 1)))
    line = shoot(mask="m.png").line
    assert line is not None
    assert 100 < line.x.max() < 120 - GRAIN / 2
    assert abs(line.y - (ROWS - TOP)).max() < GRAIN


def test_the_time_of_the_first_frame_may_be_given() -> None:
    found, given = shoot().flow.t, shoot(start="50 ms").flow.t
    step = float(np.diff(found)[0])
    assert (given[0] - 0.05) / step == pytest.approx(round((given[0] - 0.05) / step), abs=0.01)
    assert given - given[0] == pytest.approx(found - found[0])


@pytest.mark.filterwarnings("ignore")
def test_command_writes_flow_and_page(capsys: pytest.CaptureFixture[str]) -> None:
    save(SHOT)
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in LAB.items()]
    command = importlib.import_module("granpinn.commands.film")
    assert command.main(["f_*.png", "--out", "flow.h5", "--force", "--steady", *flags]) == 0
    assert "chosen by region" in capsys.readouterr().out
    assert read_flow("flow.h5").particles is not None
    page = Path("flow.html").read_text()
    assert page.count("<img") == 1
    assert "http" not in page.replace("http-equiv", "")


@pytest.mark.parametrize(
    ("pictures", "said"),
    [
        ([*SHOT[:15], None, *SHOT[16:]], "15 is left out: .*f_015.png"),
        ([*SHOT[:15], SHOT[14], *SHOT[15:]], "15 .*repeated"),
        ([*SHOT[:14], *SHOT[16:]], "14 .*lost"),
        ([*SHOT[:15], *(np.roll(a, 3, axis=0) for a in SHOT[15:])], "15 .*camera moved"),
        ([*SHOT[:15], (SHOT[15] * 0.8).astype(np.uint8), *SHOT[16:]], "15 .*flickers"),
        ([*SHOT[:15], cv2.GaussianBlur(SHOT[15], (0, 0), 3), *SHOT[16:]], "15 .*blurred"),
    ],
)
def test_faults_are_named(pictures: Any, said: str) -> None:
    with pytest.warns(UserWarning, match=f"frame.*{said}"):
        shoot(pictures)


@pytest.mark.parametrize(
    ("pictures", "settings", "said"),
    [
        ([a[::-1, ::-1].copy() for a in SHOT], {}, "grains must fall"),
        ([RANDOM.integers(100, 102, a.shape, np.uint8) for a in SHOT], {}, "must have texture"),
        ([RANDOM.permutation(a.ravel()).reshape(a.shape) for a in SHOT], {}, "found again"),
        ([SHOT[0]] * 12, {}, "the grains must move"),
        ([None] * 12, {}, "must have readable frames"),
        (SHOT, {"frame_rate": "3000 Hz"}, "times gravity .*frame.rate"),
        (SHOT, {"scale": None}, "needs (--)?scale"),
        (SHOT, {"scale": "1 um/px"}, "2 to 100 px"),
        (SHOT, {"roi": "5,1"}, "LEFT:RIGHT"),
        (SHOT, {"roi": "500:600,0:90"}, "roi leaves nothing"),
        (SHOT, {"frames": "3:4"}, "at least 2 frames"),
        (SHOT, {"mask": "small.png"}, "mask must have"),
        (SHOT, {"tilt": "auto"}, "auto needs background below"),  # the picture ends at it
        (ON_FLOOR, {"tilt": "auto"}, "do not move along it"),
    ],
)
def test_what_cannot_be_measured_is_refused(pictures: Any, settings: Any, said: str) -> None:
    cv2.imwrite("small.png", SHOT[0][:9])
    with pytest.raises(DataFileError, match=said):
        shoot(pictures, **settings)


def test_a_video_has_the_frames_of_its_images() -> None:
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter("a.avi", code, 25, (COLUMNS, ROWS), isColor=False)
    for picture in SHOT:
        writer.write(picture)
    writer.release()
    frames = ImageSequence(["a.avi"])
    assert len(frames.sample(3)) == 3
    for (picture, _), expected in zip(frames, SHOT, strict=True):
        assert picture is not None
        assert np.abs(picture.astype(int) - expected).mean() < 4


def test_subpixel_shift_is_found() -> None:
    """A picture moved by a known part of a pixel, by another interpolation than the tracker's."""
    matrix = np.array([[1, 0, 1.3], [0, 1, -0.6]], np.float32)
    moved = cv2.warpAffine(SHOT[0], matrix, (COLUMNS, ROWS), flags=cv2.INTER_CUBIC)
    places = np.stack(np.meshgrid(np.arange(30, 170, 20.0), np.arange(60, 100, 10.0)), -1)
    displacements, _ = follow(SHOT[0], moved, places.reshape(-1, 2), 11)
    assert np.median(displacements, axis=0) == pytest.approx([1.3, -0.6], abs=0.05)


def test_dark_grains_before_a_bright_wall_are_the_rough_class() -> None:
    found = segmented([255 - p for p in SHOT[::8]], GRAIN, np.full_like(SHOT[0], 255))
    assert found.useful
    level = found.level(255 - SHOT[0])
    assert level[-3:].mean() > 0.6
    assert level[:5].mean() < 0.1
