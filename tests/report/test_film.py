"""The sheets of the film: the meaning of a pixel, places without grains, and the size limit."""

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
from granpinn.results import Fields
from tests.examples import make_fields
from tests.flows import make_flow
from tests.run_folder import Contents, with_values, without_frame


def pixels(png: str) -> npt.NDArray[np.uint8]:
    image = Image.open(io.BytesIO(base64.b64decode(png, validate=True)))
    assert image.mode == "P"
    assert image.info["transparency"] == films.OUTSIDE
    return np.asarray(image)


@pytest.fixture
def fields() -> Fields:
    flow = make_flow(frames=5, rows=9, columns=7)
    n = int(flow.material.sum())
    fields = make_fields(flow, p=np.linspace(0, 2, n), u=1.0, v=0.0)
    return replace(fields, x=(fields.y[1] - fields.y[0]) * np.arange(7))  # square cells


def test_a_frame_of_a_sheet_is_that_frame_upside_down(fields: Fields) -> None:
    film = films.shoot(fields, 0)
    sheet = next(s for s in film.sheets if s.name == "pressure")
    picture = pixels(sheet.png)
    assert picture.shape == (5 * film.height, film.width)
    rows, columns = films.grain_box(fields)
    for k in range(5):
        shown = picture[k * film.height : (k + 1) * film.height].astype(float)
        known = fields.frame("p", k)[rows, columns][::-1]
        assert shown.shape == known.shape
        np.testing.assert_array_equal(shown == films.OUTSIDE, np.isnan(known))
        value = sheet.low + shown / (films.OUTSIDE - 1) * (sheet.high - sheet.low)
        step = (sheet.high - sheet.low) / (films.OUTSIDE - 1)
        clipped = np.clip(known, sheet.low, sheet.high)
        assert np.nanmax(np.abs(np.where(np.isnan(known), np.nan, value) - clipped)) <= step


def test_the_still_is_the_first_frame_to_show(contents: Contents) -> None:
    fields = contents.fields
    film = films.shoot(fields, 7)
    assert len(film.times) == min(films.MAX_FRAMES, fields.t.size)
    picture = pixels(film.sheets[0].png)
    part = picture[film.start * film.height : (film.start + 1) * film.height]
    np.testing.assert_array_equal(pixels(film.still), part)
    assert film.times[film.start].startswith(f"{fields.t[7]:.3g}")


def test_all_quantities_of_a_run_are_there(contents: Contents) -> None:
    names = [sheet.name for sheet in films.shoot(contents.fields, 0).sheets]
    assert names == list(films.QUANTITIES)


def test_a_film_of_many_frames_keeps_the_first_and_the_last() -> None:
    fields = make_fields(make_flow(frames=60, rows=5, columns=6))
    film = films.shoot(fields, 59)
    assert len(film.times) == films.MAX_FRAMES
    assert film.start == films.MAX_FRAMES - 1
    assert film.times[0].startswith(f"{fields.t[0]:.3g}")
    assert film.times[-1].startswith(f"{fields.t[-1]:.3g}")


def test_noise_on_a_large_grid_stays_within_the_budget() -> None:
    flow = make_flow(frames=25, rows=300, columns=500)
    n = int(flow.material.sum())
    rng = np.random.default_rng(0)
    fields = make_fields(flow, p=rng.random(n), D2=rng.random(n), I=rng.random(n))
    budget = 400_000
    film = films.shoot(fields, 0, budget)
    assert sum(len(sheet.png) for sheet in film.sheets) <= budget
    assert films.MIN_PIXELS <= max(film.width, film.height) < films.MAX_PIXELS


def test_the_palette_marks_what_lies_outside_and_clips_the_rest() -> None:
    values = np.array([np.nan, -1.0, 0.0, 1.0, 2.0, 9.0, np.inf])
    indices = films.quantise(values, 0.0, 2.0, log=False)
    assert indices.tolist() == [255, 0, 0, 127, 254, 254, 255]
    values = np.array([0.0, -1.0, 1e-3, 1e-1, 10.0])
    assert films.quantise(values, 1e-3, 10.0, log=True).tolist() == [0, 0, 0, 127, 254]


def test_colours_get_lighter_from_low_to_high() -> None:
    # Grey print and colour-blind readers have the lightness only: it must order the values.
    r, g, b = films.palette()[: films.OUTSIDE].astype(float).T
    luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b
    assert np.all(np.diff(luminance[::8]) > 0)


@pytest.mark.parametrize(
    ("value", "log", "ends"),
    [
        (0.0, False, (0.0, 1.0)),
        (2.0, False, (0.0, 2.0)),
        (-3.0, False, (-3.0, 0.0)),
        (5.0, True, (0.5, 5.0)),
        (0.0, True, None),
        (np.nan, False, None),
    ],
)
def test_a_field_without_variation_has_a_scale(
    value: float, log: bool, ends: tuple[float, float] | None
) -> None:
    quantity = films.Quantity("f", "number", ("f",), np.asarray, log)
    found = films.scale_of(np.full((3, 4), value), quantity)
    if ends is None or value < 0:
        assert (found is None) == (ends is None)
        assert found is None or found[0] == -3.0 < found[1]
    else:
        assert found == pytest.approx(ends)


def test_pixels_of_an_uneven_grid_are_even_and_nearest() -> None:
    x = np.array([0.0, 1.0, 3.0, 4.0])
    y = np.array([0.0, 2.0])
    rows, columns = films.pixel_grid(y, x, 100)
    assert columns.tolist()[0] == 0
    assert columns.tolist() == [0, 1, 1, 2, 3] or columns.tolist() == [0, 1, 2, 2, 3]
    assert rows.size == 3
    assert films.nearest_index(x, np.array([-5.0, 0.4, 0.6, 9.0])).tolist() == [0, 0, 1, 3]


def test_a_frame_without_grains_is_transparent(contents: Contents) -> None:
    film = films.shoot(without_frame(contents.fields, 0, 0.0), 1)
    assert np.all(pixels(film.sheets[0].png)[: film.height] == films.OUTSIDE)


def test_nothing_to_show_is_said(contents: Contents) -> None:
    fields = contents.fields
    with pytest.raises(NothingToDraw, match="none of the variables"):
        films.shoot(replace(fields, values={}), 0)
    nothing = with_values(fields, **dict.fromkeys(fields.values, np.nan))
    with pytest.raises(NothingToDraw, match="no finite value"):
        films.shoot(nothing, 0)
    empty = replace(
        fields, c=np.zeros_like(fields.c), values={k: v[:0] for k, v in fields.values.items()}
    )
    with pytest.raises(NothingToDraw, match="no grid point inside the grains"):
        films.shoot(empty, 0)
