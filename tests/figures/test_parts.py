"""The figure of the law on parts of the data."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from granpinn.figures.parts import law_on_parts
from granpinn.figures.style import NothingToDraw, for_phones
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.parts import SPLITS, Part, Parts, Split
from tests.figures.conftest import Contents


def split(name: str, factor: float, **numbers: float) -> Split:
    first, second = SPLITS[name]
    theta = {"mu_s": 0.4, "mu_2": 0.6, "I0": 0.3}
    more = theta | {"mu_s": 0.4 * factor, "mu_2": 0.6 * factor}
    parts = Part(first, theta, 0.01, 0.1, 0.5), Part(second, more, 0.02, 0.2, 0.5)
    return Split(name, parts, **numbers)


def shown(result: Result) -> list[Axes]:
    return [axes for axes in law_on_parts(result).figure.axes if axes.get_visible()]


def test_each_half_is_drawn_over_its_own_I(contents: Contents) -> None:
    known = {"I": 0.05, "percent": 15.0, "std_percent": 2.0}
    splits = (
        split("time", 1.15, **known, model_percent=0.6, limit_percent=6.0),
        split("rate", 1.15, **known),
        split("side", 1.0),
    )
    result = replace(contents.result, parts=Parts(0.05, splits))
    panels = shown(result)
    titles = ["+15 % (limit 6 %)", "+15 % (limit not known)", "not compared"]
    assert [axes.get_title(loc="left") for axes in panels] == titles
    curves = {str(line.get_label()): line for line in panels[0].get_lines()}
    late = np.asarray(curves["late times"].get_xdata(), float)
    assert (late.min(), late.max()) == pytest.approx((0.02, 0.2))
    mu = LAWS[result.law.name].friction(late, 0.46, 0.69, 0.3)
    np.testing.assert_allclose(np.asarray(curves["late times"].get_ydata(), float), mu)
    assert "late times need 15 % more friction" in law_on_parts(result).caption


def test_nothing_is_cut_or_covered_on_phones(contents: Contents) -> None:
    known = {"I": 0.05, "percent": 15.0, "std_percent": 2.0}
    splits = (split("time", 1.15, **known, limit_percent=6.0), split("rate", 1.15, **known))
    with for_phones():
        figure = law_on_parts(replace(contents.result, parts=Parts(0.05, splits))).figure
    first, second = figure.axes
    assert first.get_position().y0 > second.get_position().y1  # one above the other
    figure.draw_without_rendering()
    for axes in figure.axes:
        labels = [text for text in axes.get_xticklabels(which="both") if text.get_text()]
        boxes = [text.get_window_extent() for text in labels]
        ends = sorted((b.x0, b.x1) for b in boxes if axes.bbox.x0 <= b.x1 <= axes.bbox.x1)
        assert len(ends) >= 2
        assert all(end < start for (_, end), (start, _) in itertools.pairwise(ends))
        assert axes._left_title.get_window_extent().x1 <= figure.bbox.x1  # type: ignore[attr-defined]


def test_nothing_is_drawn_without_parts(contents: Contents) -> None:
    for parts in (None, Parts(0.05, ())):
        with pytest.raises(NothingToDraw, match="law on parts of the data is not known"):
            law_on_parts(replace(contents.result, parts=parts))
