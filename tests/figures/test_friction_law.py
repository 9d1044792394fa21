"""The figure of the friction law: its curve, band, points and truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granpinn.figures import curves
from granpinn.results import Covariance, Result
from granpinn.results.result import friction_sd
from granpinn.uncertainty.determined import stress_points, with_curve
from tests.figures.drawn import labels, line, xy
from tests.run_folder import Array, Contents

COVARIANCE = Covariance(("mu_s", "mu_2"), ((1.6e-4, -6e-5), (-6e-5, 9e-4)))


def over(result: Result, low: float = 2e-3, high: float = 0.3) -> Result:
    """The result with its curve; a hundred points at each of these I, and their stress."""
    I = np.repeat(np.array([low, high]), 100)
    ratio = np.tile(np.linspace(0.3, 0.5, 100), 2)
    return with_curve(result, (low, high), stress_points(I, ratio, (low, high)))


def test_the_law_is_drawn_over_the_covered_band_only(result: Result, contents: Contents) -> None:
    law = curves.friction_law(over(result), contents.fields).figure.axes[0]
    for name, (mu_s, mu_2, I_0) in {
        "identified": (0.4, 0.6, 0.25),
        "true": (0.38, 0.64, 0.3),
    }.items():
        I, mu = xy(line(law, name))
        assert (I[0], I[-1]) == (2e-3, 0.3)
        np.testing.assert_allclose(mu, mu_s + (mu_2 - mu_s) / (1 + I_0 / I), rtol=1e-12)
    assert labels(law) == ["identified", "true", r"$|\tau|/p$ of the fit"]


def test_the_points_of_the_fit_are_drawn_with_their_spread(
    result: Result, contents: Contents
) -> None:
    drawing = curves.friction_law(over(result), contents.fields)
    (points,) = drawing.figure.axes[0].containers
    middle, _, (spread,) = points.lines
    I, mu = xy(middle)
    assert I.tolist() == [2e-3, 0.3]
    np.testing.assert_allclose(mu, 0.4)
    ends = np.array(spread.get_segments())[:, :, 1]
    np.testing.assert_allclose(ends, [[0.3 + 0.2 * 0.16, 0.3 + 0.2 * 0.84]] * 2)
    assert "the stress ratio of the fit, " in drawing.caption
    strong = curves.friction_law(replace(over(result), form="strong"), contents.fields)
    assert "which is that of the law by construction" in strong.caption


def test_the_band_is_that_of_the_result(result: Result, contents: Contents) -> None:
    known = over(replace(result, covariance=COVARIANCE))
    law = curves.friction_law(known, contents.fields).figure.axes[0]
    assert labels(law)[:2] == ["identified", "90 % band"]
    (filled,) = (item for item in law.collections if item.get_label() == "90 % band")
    vertices = np.asarray(filled.get_paths()[0].vertices)
    curve = known.law.curve
    assert curve is not None
    assert curve.low is not None
    assert curve.high is not None
    for k in (0, 40, 79):
        edges = vertices[np.isclose(vertices[:, 0], curve.I[k]), 1]
        assert (edges.min(), edges.max()) == pytest.approx((curve.low[k], curve.high[k]))


def test_a_band_without_meaning_is_left_out(result: Result, contents: Contents) -> None:
    known = over(replace(result, covariance=COVARIANCE))
    curve = known.law.curve
    assert curve is not None
    assert curve.high is not None
    wide = (*curve.high[:40], *(100 * high for high in curve.high[40:]))
    known = replace(known, law=replace(known.law, curve=replace(curve, high=wide)))
    drawing = curves.friction_law(known, contents.fields)
    axes = drawing.figure.axes[0]
    (filled,) = (item for item in axes.collections if item.get_label() == "90 % band")
    assert np.asarray(filled.get_paths()[0].vertices)[:, 0].max() < curve.I[40]
    assert "Where there is no band, mu(I) is not determined" in drawing.caption


def test_the_sd_of_the_law_is_first_order_in_all_three_parameters(result: Result) -> None:
    I = np.array([1e-3, 0.1, 2.0])
    values = np.array([0.4, 0.6, 0.25])
    matrix = np.array([[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 2.0]]) * 1e-4

    def mu(p: Array) -> Array:
        return p[0] + (p[1] - p[0]) / (1 + p[2] / I)

    step = 1e-6 * np.eye(3)
    J = np.stack([(mu(values + h) - mu(values - h)) / 2e-6 for h in step])
    order = [2, 0, 1]
    covariance = Covariance(("I0", "mu_s", "mu_2"), tuple(map(tuple, matrix[order][:, order])))
    sd = friction_sd(I, result, covariance)
    np.testing.assert_allclose(sd, np.sqrt(np.einsum("in,ij,jn->n", J, matrix, J)), rtol=1e-6)
