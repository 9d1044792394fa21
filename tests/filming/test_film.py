"""A film of a layer that is sheared: vectors, surface, release, faults, page and command."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

import granpinn
from granpinn.data import read_flow
from granpinn.filming import FilmSettings
from granpinn.filming.frames import opened
from granpinn.filming.measurement import measure
from granpinn.filming.segmentation import segmented
from granpinn.filming.tracking import follow
from granpinn.importers import DataFileError

ROWS, COLUMNS, TOP = 120, 200, 40  # px; the grains lie below row TOP
GRAIN = 6.0  # px
STILL = 5  # frames before the release
LAB: dict[str, Any] = {
    "scale": "0.1 mm/px",
    "frame_rate": "300 Hz",
    "grain_diameter": "0.6 mm",
    "grain_density": "2500 kg/m^3",
    "solid_fraction": 0.6,
    "tilt": "30 deg",
    "origin": f"0,{ROWS - 1}",
}


def speed(y: Any, k: float) -> Any:
    """Of the layer to the right, px/frame: faster at the top, and with time."""
    return 0.03 * (ROWS - y) * min(max(k - STILL, 0) / 4, 1.0)


TEXTURE = gaussian_filter(
    np.random.default_rng(5).standard_normal((ROWS, 3 * COLUMNS)), 1.5, mode="wrap"
)


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


@pytest.fixture(scope="session")
def shot() -> list[Any]:
    return [frame(k) for k in range(24)]


def save(pictures: list[Any], folder: Path) -> str:
    """The pattern of the files; None is a file that is no picture."""
    folder.mkdir(exist_ok=True)
    for k, picture in enumerate(pictures):
        if picture is None:
            (folder / f"f_{k:03d}.png").write_bytes(b"\x89PNG no picture")
        else:
            cv2.imwrite(str(folder / f"f_{k:03d}.png"), picture)
    return str(folder / "*.png")


def test_velocity_surface_and_release(shot: list[Any], tmp_path: Path) -> None:
    """The chain on a known motion; errors are held to a few of the stated deviations."""
    found = measure(save(shot, tmp_path / "a"), FilmSettings(**LAB))
    field = found.fields[-1]
    good = field.vectors.kept()
    error = good.u - speed(good.y, field.number)
    assert good.x.size > 200
    assert np.sqrt(np.mean(error**2)) < 0.05 * speed(TOP, field.number)
    assert np.mean(np.abs(good.v) < 3 * good.sd) > 0.9
    assert found.judgement.release == pytest.approx(STILL, abs=1.5)
    assert found.line is not None
    assert abs(np.median(found.line.y) - (ROWS - TOP)) < GRAIN / 2
    assert not found.judgement.said
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
def test_tilt_of_a_level_floor(tmp_path: Path, degrees: float) -> None:
    pictures = [falling(k, np.radians(degrees)) for k in range(24)]
    settings = FilmSettings(**LAB | {"tilt": "auto", "frame_rate": "900 Hz"})
    found = measure(save(pictures, tmp_path / "a"), settings)
    x, y = found.flow.gravity
    assert np.degrees(np.arctan2(x, -y)) == pytest.approx(degrees, abs=2)  # on 20 grains


def test_a_floor_along_which_the_grains_move_is_not_level(shot: list[Any], tmp_path: Path) -> None:
    below = [np.pad(p, ((0, 30), (0, 0)), constant_values=10) for p in shot]
    with pytest.raises(DataFileError, match="move along it"):
        granpinn.film(save(below, tmp_path / "a"), **LAB | {"tilt": "auto"})


def test_no_surface_is_seen_at_a_mask(shot: list[Any], tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "m.png"), 255 * np.tile(np.arange(COLUMNS) < 120, (ROWS, 1)))
    settings = FilmSettings(**LAB, mask=str(tmp_path / "m.png"))
    line = measure(save(shot, tmp_path / "a"), settings).line
    assert line is not None
    assert 100 < line.x.max() < 120 - GRAIN / 2
    assert abs(line.y - (ROWS - TOP)).max() < GRAIN


def test_the_time_of_the_first_frame_may_be_given(shot: list[Any], tmp_path: Path) -> None:
    pattern = save(shot, tmp_path / "a")
    found, given = (granpinn.film(pattern, **LAB, **more) for more in ({}, {"start": "50 ms"}))
    step = float(np.diff(found.t)[0])
    assert (given.t[0] - 0.05) / step == pytest.approx(round((given.t[0] - 0.05) / step), abs=0.01)
    assert given.t - given.t[0] == pytest.approx(found.t - found.t[0])


def test_command_writes_flow_and_page(
    shot: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "flow.h5"
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in LAB.items()]
    command = importlib.import_module("granpinn.commands.film")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        code = command.main(
            [save(shot, tmp_path / "a"), "--out", str(out), "--force", "--steady", *flags]
        )
    captured = capsys.readouterr()
    assert code == 0, captured.err
    assert "chosen by region" in captured.out
    assert read_flow(out).particles is not None
    page = out.with_suffix(".html").read_text()
    assert page.count("<img") == 3
    assert "http" not in page.replace("http-equiv", "")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda p: [*p[:15], None, *p[16:]], r"\(f_015.png\) is left out"),
        (lambda p: [*p[:15], p[14], *p[15:]], "15 .*repeated"),
        (lambda p: [*p[:14], *p[16:]], "14 .*lost"),
        (lambda p: [*p[:15], *(np.roll(a, 3, axis=0) for a in p[15:])], "15 .*camera moved"),
        (lambda p: [*p[:15], (p[15] * 0.8).astype(np.uint8), *p[16:]], "15 .*flickers"),
        (lambda p: [*p[:15], cv2.GaussianBlur(p[15], (0, 0), 3), *p[16:]], "15 .*blurred"),
    ],
)
def test_faults_are_named(
    shot: list[Any], tmp_path: Path, spoil: Callable[[list[Any]], list[Any]], said: str
) -> None:
    with pytest.warns(UserWarning, match=f"frame.*{said}"):
        granpinn.film(save(spoil(shot), tmp_path / "a"), **LAB)


def uniform(pictures: list[Any]) -> list[Any]:
    random = np.random.default_rng(1)
    return [(100 + random.integers(0, 2, p.shape)).astype(np.uint8) for p in pictures]


def too_fast(pictures: list[Any]) -> list[Any]:
    random = np.random.default_rng(1)
    return [random.permutation(p[TOP:].ravel()).reshape(p[TOP:].shape) for p in pictures]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda p: [a[::-1, ::-1].copy() for a in p], "grains must fall"),
        (uniform, "must have texture"),
        (lambda p: [np.zeros_like(p[0])] * 12, "must have texture"),
        (too_fast, "found again"),
        (lambda p: [p[0]] * 12, "the grains must move"),
    ],
)
def test_impossible_films_are_refused(
    shot: list[Any], tmp_path: Path, spoil: Callable[[list[Any]], list[Any]], said: str
) -> None:
    with pytest.raises(DataFileError, match=said):
        granpinn.film(save(spoil(shot), tmp_path / "a"), **LAB)


def test_a_video_has_the_frames_of_its_images(shot: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "a.avi"
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), code, 25, (COLUMNS, ROWS), isColor=False)
    for picture in shot:
        writer.write(picture)
    writer.release()
    frames = opened([path])
    found = [f.picture for f in frames]
    assert len(found) == frames.count == len(shot)
    for picture, expected in zip(found, shot, strict=True):
        assert picture is not None
        assert np.abs(picture.astype(int) - expected).mean() < 4
    assert len(frames.sample(3)) == 3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frame_rate": "3000 Hz"}, "times gravity .*frame.rate"),
        ({"scale": None}, "needs scale"),
        ({"scale": "1 um/px"}, "2 to 100 px"),
        ({"roi": "5:1,2:3"}, "LEFT:RIGHT"),
        ({"roi": "500:600,0:90"}, "leaves nothing"),
        ({"frames": "a:b"}, "FIRST:LAST:STEP"),
        ({"columns": "x=a"}, "unknown setting columns"),
        ({"mask": "small.png"}, "mask must have"),
        ({"tilt": "auto"}, "auto needs a straight floor"),  # the picture ends at it
    ],
)
def test_settings(
    shot: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Any, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("small.png", shot[0][:9])
    with pytest.raises(DataFileError, match=said):
        granpinn.film(save(shot, tmp_path / "a"), **(LAB | change))


def test_subpixel_shift_is_found(shot: list[Any]) -> None:
    """A picture moved by a known part of a pixel, by another interpolation than the tracker's."""
    matrix = np.array([[1, 0, 1.3], [0, 1, -0.6]], np.float32)
    moved = cv2.warpAffine(shot[0], matrix, (COLUMNS, ROWS), flags=cv2.INTER_CUBIC)
    places = np.stack(np.meshgrid(np.arange(30, 170, 20.0), np.arange(60, 100, 10.0)), -1)
    displacements, _ = follow(shot[0], moved, places.reshape(-1, 2), 11)
    assert np.median(displacements, axis=0) == pytest.approx([1.3, -0.6], abs=0.05)


def test_dark_grains_before_a_bright_wall_are_the_rough_class(shot: list[Any]) -> None:
    found = segmented([255 - p for p in shot[::8]], GRAIN)
    assert found.useful
    level = found.level(255 - shot[0])
    assert level[-3:].mean() > 0.6
    assert level[:5].mean() < 0.1
