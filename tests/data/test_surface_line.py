"""The free surface as heights at the columns of a grid."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.data import Surface
from granpinn.data.surface import line_heights

T = np.array([0.0, 1.0, 2.0])
X = np.array([0.0, 0.5, 1.5, 3.0])


def heights(*points: tuple[float, float, float]) -> np.ndarray:
    """Of points (t, x, y) in any order."""
    return line_heights(T, X, Surface(*np.array(points, float).T))


def test_heights_are_linear_between_points_and_missing_beyond_them() -> None:
    found = heights((1, 2, 5), (1, 0.25, 1.5))
    np.testing.assert_allclose(found[1], [np.nan, 2, 4, np.nan])
    assert np.isnan(found[[0, 2]]).all()


@pytest.mark.parametrize("late", [0.0, 1e-7, 0.3])
def test_a_line_belongs_to_the_frame_nearest_in_time(late: float) -> None:
    found = heights((1 + late, 0, 1), (1 + late, 3, 1), (2, 0, 7), (2, 3, 7))
    assert np.isnan(found[0]).all()
    np.testing.assert_array_equal(found[1:], [[1] * 4, [7] * 4])


def test_lines_between_the_frames_are_not_mixed() -> None:
    """Every second line lies between two frames, and the last one after all of them."""
    times = np.arange(0, 3, 0.25)
    found = heights(*((t, x, 10 * t) for t in times for x in (0, 3)))
    np.testing.assert_allclose(found, np.repeat(10 * T[:, None], 4, axis=1))
