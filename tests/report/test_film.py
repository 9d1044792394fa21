"""The film: the meaning of a pixel, its frames and axes, places without grains, the size limit."""

from __future__ import annotations

import base64
import io
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from granpinn.figures.style import NothingToDraw
from granpinn.report import film as films
from granpinn.report import sheets
from granpinn.report.pixels import grain_box
from granpinn.results import Fields
from tests.examples import make_fields
from tests.flows import make_flow
from tests.run_folder import Contents, with_values


def pixels(png: str, transparent: int = sheets.OUTSIDE) -> npt.NDArray[np.uint8]:
    image = Image.open(io.BytesIO(base64.b64decode(png, validate=True)))
    assert image.mode == "P"
    assert image.info["transparency"] == transparent
    return np.asarray(image)


def frame_of(sheet: npt.NDArray[np.uint8], film: films.Film, k: int) -> npt.NDArray[np.uint8]:
    top, left = k // film.columns * film.height, k % film.columns * film.width
    return sheet[top : top + film.height, left : left + film.width]


@pytest.fixture
def fields() -> Fields:
    flow = make_flow(frames=5, rows=9, columns=7)
    n = int(flow.material.sum())
    fields = make_fields(flow, p=np.linspace(0, 2, n), u=1.0, v=0.0)
    return replace(fields, x=(fields.y[1] - fields.y[0]) * np.arange(7))  # square cells


def test_a_frame_of_a_sheet_is_that_frame_upside_down(fields: Fields) -> None:
    film = films.shoot(fields, 0)
    picture = pixels(film.sheet)
    rows, columns = grain_box(fields)
    for k in range(5):
        shown = frame_of(picture, film, k).astype(float)
        known = fields.frame("p", k)[rows, columns][::-1]
        assert shown.shape == known.shape
        np.testing.assert_array_equal(shown == sheets.OUTSIDE, np.isnan(known))
        value = film.low + shown / (sheets.LEVELS - 1) * (film.high - film.low)
        step = (film.high - film.low) / (sheets.LEVELS - 1)
        clipped = np.clip(known, film.low, film.high)
        assert np.nanmax(np.abs(np.where(np.isnan(known), np.nan, value) - clipped)) <= step


@pytest.mark.parametrize("k", [0, 123, 1999])
def test_a_film_of_many_frames_keeps_the_first_the_last_and_that_of_the_figures(k: int) -> None:
    frames = films.frames_of(2000, k)
    assert {0, k, 1999} <= set(frames.tolist())
    assert films.MAX_FRAMES - 1 <= frames.size <= films.MAX_FRAMES
    assert set(np.diff(frames)) <= {*range(1, 12)}
    assert films.frames_of(films.MAX_FRAMES, k).tolist() == list(range(films.MAX_FRAMES))


@pytest.mark.parametrize(
    ("shape", "columns"), [((1, 9, 9), 1), ((6, 2, 10), 1), ((5, 10, 4), 4), ((9, 7, 7), 3)]
)
def test_a_sheet_holds_every_frame_once(shape: tuple[int, int, int], columns: int) -> None:
    frames, height, width = shape
    assert sheets.columns_of(*shape) == columns
    numbers = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape) % 200
    sheet = sheets.laid_out(numbers, columns)
    for k in range(frames):
        top, left = k // columns * height, k % columns * width
        part = sheet[top : top + height, left : left + width]
        np.testing.assert_array_equal(part, numbers[k])
    assert np.count_nonzero(sheet == sheets.OUTSIDE) == sheet.size - numbers.size


def test_noise_on_a_large_grid_stays_within_the_budget() -> None:
    flow = make_flow(frames=25, rows=300, columns=500)
    n = int(flow.material.sum())
    rng = np.random.default_rng(0)
    fields = make_fields(flow, p=rng.random(n), D2=rng.random(n), I=rng.random(n))
    budget = 400_000
    film = films.shoot(fields, 0, budget)
    assert len(film.sheet) <= budget
    assert films.MIN_PIXELS <= max(film.width, film.height) < films.MAX_PIXELS


def test_nothing_to_show_is_said(contents: Contents) -> None:
    fields = contents.fields
    with pytest.raises(NothingToDraw, match="no pressure"):
        films.shoot(replace(fields, values={}), 0)
    nothing = with_values(fields, **dict.fromkeys(fields.values, np.nan))
    with pytest.raises(NothingToDraw, match="no finite pressure"):
        films.shoot(nothing, 0)
    empty = replace(
        fields, c=np.zeros_like(fields.c), values={k: v[:0] for k, v in fields.values.items()}
    )
    with pytest.raises(NothingToDraw, match="no grid point inside the grains"):
        films.shoot(empty, 0)
