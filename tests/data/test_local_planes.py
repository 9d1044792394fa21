"""Planes through the neighbors of a height: exact for planes, absent at steps."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.data.outline import smoothed

SPACING = 0.1


def rounded(heights: np.ndarray) -> np.ndarray:
    """The middle of the interval of the grid that holds each height."""
    return (np.floor(heights / SPACING) + 0.5) * SPACING


@pytest.mark.parametrize("shape", [(30, 40), (1, 40), (30, 1), (1, 1), (2, 3)])
def test_a_plane_stays_with_its_slope(shape: tuple[int, int]) -> None:
    t, x = np.indices(shape)
    plane = 3 + 0.02 * t - 0.05 * x
    heights, slope = smoothed(plane, np.full(shape, SPACING))
    np.testing.assert_allclose(heights, plane, atol=1e-7)
    np.testing.assert_allclose(slope, -0.05 if shape[1] > 1 else 0.0, atol=1e-7)


def test_heights_of_a_grid_become_four_times_as_exact() -> None:
    t, x = np.indices((60, 50))
    true = 2 + np.sin(x / 20 + t / 40)
    read = rounded(true)
    found, _ = smoothed(read, np.full(true.shape, SPACING))
    before, after = (float(np.median(np.abs(h - true))) for h in (read, found))
    assert before == pytest.approx(SPACING / 4, rel=0.2)
    assert after < before / 4


def test_a_step_has_no_plane() -> None:
    heights = np.where(np.indices((12, 30))[1] < 15, 1.0, 0.2)
    found, slope = smoothed(heights, np.full(heights.shape, SPACING))
    near = np.isin(np.arange(30), (14, 15))
    assert np.isnan(found[:, near]).all()
    assert np.isnan(slope[:, near]).all()
    np.testing.assert_allclose(found[:, ~near], heights[:, ~near], atol=1e-7)
    np.testing.assert_allclose(slope[:, ~near], 0.0, atol=1e-7)


def test_places_without_a_height_have_none_and_do_not_count() -> None:
    x = np.indices((8, 40))[1]
    heights = np.where(x < 30, 1 + 0.03 * x, np.nan)
    heights[3, 10] = np.nan
    found, slope = smoothed(heights, np.full(heights.shape, SPACING))
    np.testing.assert_array_equal(np.isnan(found), np.isnan(heights))
    np.testing.assert_allclose(found, heights, atol=1e-7)
    np.testing.assert_allclose(slope[np.isfinite(heights)], 0.03, atol=1e-7)
