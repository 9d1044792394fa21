"""Maps of one time show the values of the fields, at their place, in their unit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from granpinn.figures import maps, style
from granpinn.results import Fields
from granpinn.results.fields import Units
from tests.run_folder import Array, Contents

K = 8


@pytest.fixture
def fields(contents: Contents) -> Fields:
    return contents.fields


def mesh(axes: Axes) -> QuadMesh:
    (found,) = (item for item in axes.collections if isinstance(item, QuadMesh))
    return found


def shown(axes: Axes) -> Array:
    """The values of a map inside the grains, in the order of the grid."""
    values = np.ma.masked_invalid(mesh(axes).get_array())
    return np.asarray(values.compressed())


def inside(frame: Array) -> Array:
    return frame[np.isfinite(frame)]


def test_the_window_holds_all_grains_and_one_cell_more(fields: Fields) -> None:
    window = maps.grain_window(fields, K)
    outside = fields.c[K].copy()
    outside[window.rows, window.columns] = 0
    assert not (outside > 0.5).any()
    cut = fields.c[K, window.rows, window.columns] > 0.5
    assert not cut[-1].any()
    assert cut[-2].any()


def test_pressure_beside_its_reference(fields: Fields) -> None:
    drawing = maps.pressure_fields(fields, float(fields.t[K]))
    predicted, reference, difference = panels = drawing.figure.axes[:3]
    p, known = fields.frame("p", K), fields.frame("p_reference", K)
    for axes, expected in zip(panels, (p, known, p - known), strict=True):
        np.testing.assert_array_equal(shown(axes), inside(expected))
    assert mesh(predicted).get_clim() == mesh(reference).get_clim()
    low, high = mesh(difference).get_clim()
    assert low == -high
    assert "(b) reference" in drawing.caption
    assert drawing.caption.startswith(f"In the grains at t = {fields.t[K]:.3g} s")
    assert predicted.get_ylabel() == "$y$ [m]"
    assert drawing.figure.axes[3].get_ylabel() == "$p$ [units of the file]"


def test_speed_beside_that_of_the_flow_file(fields: Fields) -> None:
    fields = replace(fields, units=Units("1", "1"))
    drawing = maps.velocity_fields(fields, float(fields.t[K]))
    for axes, suffix in zip(drawing.figure.axes, ("", "_reference"), strict=False):
        speed = np.hypot(fields.frame("u" + suffix, K), fields.frame("v" + suffix, K))
        np.testing.assert_array_equal(shown(axes), inside(speed))
    assert drawing.figure.axes[0].get_ylabel() == "$y$"
    assert drawing.caption.startswith(f"In the grains at t = {fields.t[K]:.3g}: (a)")


@pytest.mark.parametrize("height", [0.02, 1.0, 20.0])
def test_grains_of_every_shape_fit_their_figure(
    fields: Fields, tmp_path: Path, height: float
) -> None:
    fields = replace(fields, y=height * fields.y)
    speed = maps.velocity_fields(fields, float(fields.t[K])).figure
    style.save(speed, tmp_path / "speed.png")  # a map without room would warn
    first, second = (axes.get_position() for axes in speed.axes[:2])
    stacked = first.y0 > second.y1
    assert stacked == (maps.aspect_of(fields, maps.grain_window(fields, K)) < maps.WIDE)
