"""Curves and the style of all figures: the drawn values equal the values in the run folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from granpinn.data import Truth
from granpinn.figures import album, curves, style
from granpinn.figures.style import NothingToDraw
from granpinn.physics.terms import NAMES
from granpinn.results import (
    Covariance,
    Fields,
    InertialNumber,
    Parameter,
    Parameters,
    Result,
    summary,
)
from granpinn.results.records import ErrorBars
from tests.run_folder import Array, Contents, with_values

BAND = InertialNumber(q05=2e-3, median=0.02, q95=0.3)
COVARIANCE = Covariance(("mu_s", "mu_2"), ((1.6e-4, -6e-5), (-6e-5, 9e-4)))


@pytest.fixture
def result(contents: Contents) -> Result:
    """A result with round numbers over a known band."""
    parameters = Parameters(
        mu_s=Parameter(0.4, False), mu_2=Parameter(0.6, False), I0=Parameter(0.25, True)
    )
    truth = Truth(mu_s=0.38, mu_2=0.64, I0=0.3)
    return replace(
        contents.result,
        parameters=parameters,
        truth=truth,
        inertial_number=BAND,
        covariance=None,
        error_bars=None,
    )


def line(axes: Axes, name: str) -> Line2D:
    (found,) = (item for item in axes.lines if item.get_label() == name)
    return found


def xy(found: Line2D) -> tuple[Array, Array]:
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def labels(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [text.get_text() for text in legend.get_texts()] if legend else []


def bars(axes: Axes) -> Array:
    """Heights of the filled bars of a histogram."""
    return np.array([bar.get_height() for bar in axes.containers[0]])


def test_the_law_is_drawn_over_the_covered_band_only(result: Result, contents: Contents) -> None:
    law = curves.friction_law(result, contents.fields).figure.axes[0]
    for name, (mu_s, mu_2, I_0) in {
        "identified": (0.4, 0.6, 0.25),
        "true": (0.38, 0.64, 0.3),
    }.items():
        I, mu = xy(line(law, name))  # noqa: E741
        assert (I[0], I[-1]) == pytest.approx((BAND.q05, BAND.q95))
        np.testing.assert_allclose(mu, mu_s + (mu_2 - mu_s) / (1 + I_0 / I), rtol=1e-12)
    assert labels(law) == ["identified", "true"]


def test_a_band_that_starts_at_rest_is_cut_where_the_law_is_flat(
    result: Result, contents: Contents
) -> None:
    at_rest = replace(result, inertial_number=InertialNumber(0.0, 0.0, 0.0))
    law = curves.friction_law(at_rest, contents.fields).figure.axes[0]
    I, mu = xy(line(law, "identified"))  # noqa: E741
    assert I[0] == pytest.approx(1e-4)
    assert np.ptp(mu) < 1e-4


@pytest.mark.parametrize("truth", [None, Truth(), Truth(mu_s=0.4), Truth(I0=0.3)], ids=str)
def test_the_law_without_its_truth(result: Result, contents: Contents, truth: Truth | None) -> None:
    drawing = curves.friction_law(replace(result, truth=truth), contents.fields)
    assert labels(drawing.figure.axes[0]) == ["identified"]
    assert "generated the data" not in drawing.caption


def test_a_truth_without_I0_is_drawn_with_the_given_one(result: Result, contents: Contents) -> None:
    truth = replace(result, truth=Truth(mu_s=0.38, mu_2=0.64))
    I, mu = xy(line(curves.friction_law(truth, contents.fields).figure.axes[0], "true"))  # noqa: E741
    np.testing.assert_allclose(mu, 0.38 + 0.26 / (1 + 0.25 / I), rtol=1e-12)


def test_the_law_needs_to_know_the_band(result: Result, contents: Contents) -> None:
    with pytest.raises(NothingToDraw, match="band of the inertial number"):
        curves.friction_law(replace(result, inertial_number=None), contents.fields)


def test_the_band_of_uncertainty_is_90_percent_of_a_sample(
    result: Result, contents: Contents
) -> None:
    """Against laws drawn from the covariance: mu is linear in mu_s and mu_2."""
    drawing = curves.friction_law(replace(result, covariance=COVARIANCE), contents.fields)
    law = drawing.figure.axes[0]
    assert labels(law) == ["identified", "90 % band", "true"]
    vertices = np.asarray(law.collections[0].get_paths()[0].vertices)
    I, _ = xy(line(law, "identified"))  # noqa: E741
    drawn = np.random.default_rng(0).multivariate_normal([0.4, 0.6], COVARIANCE.matrix, 40_000)
    for at in (I[0], I[150], I[-1]):
        edges = vertices[np.isclose(vertices[:, 0], at), 1]
        mu = drawn[:, 0] + (drawn[:, 1] - drawn[:, 0]) / (1 + 0.25 / at)
        low, high = np.quantile(mu, (0.05, 0.95))
        assert (edges.min(), edges.max()) == pytest.approx((low, high), abs=0.02 * (high - low))


def test_the_band_is_as_wide_as_the_intervals(result: Result, contents: Contents) -> None:
    bars = ErrorBars((0.01, 0.02), (0.01, 0.02), (5.0, 6.0), (2.0, 3.29), "a test", False)
    heights = []
    for error_bars in (None, bars):
        known = replace(result, covariance=COVARIANCE, error_bars=error_bars)
        law = curves.friction_law(known, contents.fields).figure.axes[0]
        heights.append(np.ptp(np.asarray(law.collections[0].get_paths()[0].vertices)[:5, 1]))
    assert heights[1] / heights[0] == pytest.approx(2, rel=0.01)


def test_the_sd_of_the_law_is_first_order_in_all_three_parameters(result: Result) -> None:
    I = np.array([1e-3, 0.1, 2.0])  # noqa: E741
    values = np.array([0.4, 0.6, 0.25])
    matrix = np.array([[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 2.0]]) * 1e-4

    def mu(p: Array) -> Array:
        return p[0] + (p[1] - p[0]) / (1 + p[2] / I)

    step = 1e-6 * np.eye(3)
    J = np.stack([(mu(values + h) - mu(values - h)) / 2e-6 for h in step])
    order = [2, 0, 1]
    covariance = Covariance(("I0", "mu_s", "mu_2"), tuple(map(tuple, matrix[order][:, order])))
    sd = summary.friction_sd(I, result, covariance)
    np.testing.assert_allclose(sd, np.sqrt(np.einsum("in,ij,jn->n", J, matrix, J)), rtol=1e-6)


def test_the_histogram_of_I_counts_every_grain_point_after_the_start(
    result: Result, contents: Contents
) -> None:
    K = contents.fields.index.size
    I = np.geomspace(2e-4, 5, K)  # noqa: E741
    fields = with_values(contents.fields, I=I, D2=np.where(np.arange(K) < K // 4, 1e3, 0))
    for axes in (
        curves.inertial_number(result, fields).figure.axes[0],
        curves.friction_law(result, fields).figure.axes[1],
    ):
        assert bars(axes).sum() == pytest.approx(1)
        flowing = np.asarray(axes.patches[-1].get_path().vertices)[:, 1]
        assert 0 < flowing.max() <= bars(axes).max() * (1 + 1e-12)


def test_points_at_the_start_are_not_counted(result: Result, contents: Contents) -> None:
    fields = replace(contents.fields, t=contents.fields.t - contents.fields.t[0])
    start = fields.time_of_points() == 0
    drawing = curves.inertial_number(result, with_values(fields, I=np.where(start, 0.5, 0.02)))
    assert bars(drawing.figure.axes[0]).max() == pytest.approx(1)


def test_the_share_of_points_below_the_histogram_is_said(
    result: Result, contents: Contents
) -> None:
    K = contents.fields.index.size
    fields = with_values(contents.fields, I=np.where(np.arange(K) < 0.25 * K, 1e-6, 0.1))
    drawing = curves.inertial_number(result, fields)
    assert "25 % of the points have I below 0.0001" in drawing.caption
    assert bars(drawing.figure.axes[0]).sum() == pytest.approx(0.75, abs=1e-3)
    assert labels(drawing.figure.axes[0])[-2:] == ["$I_0$ = 0.25", "median 0.1"]
    assert xy(line(drawing.figure.axes[0], "$I_0$ = 0.25"))[0] == pytest.approx(0.25)


def test_a_median_below_the_histogram_has_no_line(result: Result, contents: Contents) -> None:
    axes = curves.inertial_number(result, with_values(contents.fields, I=0.0)).figure.axes[0]
    assert not [name for name in labels(axes) if name.startswith("median")]


def test_the_course_of_the_training_is_the_history(result: Result, contents: Contents) -> None:
    history = contents.history
    scalars, terms = curves.evolution(result, history).figure.axes
    for name, symbol, true in (("mu_s", r"$\mu_s$", 0.38), ("mu_2", r"$\mu_2$", 0.64)):
        step, value = xy(line(scalars, symbol))
        np.testing.assert_array_equal(step, history["step"])
        np.testing.assert_array_equal(value, history[name])
        np.testing.assert_array_equal(xy(line(scalars, f"{symbol} true"))[1], true)
    assert labels(terms) == ["loss", *NAMES]
    for name in labels(terms):
        np.testing.assert_array_equal(xy(line(terms, name))[1], history[name])
    assert np.isnan(history["momentum"][0])  # the pre-fit has no such term


def test_a_course_without_truth_surface_or_second_row(result: Result, contents: Contents) -> None:
    history = {name: column[-1:] for name, column in contents.history.items()}
    history["surface"] = np.zeros(1)  # level V0
    drawing = curves.evolution(replace(result, truth=None), history)
    scalars, terms = drawing.figure.axes
    assert labels(scalars) == [r"$\mu_s$", r"$\mu_2$"]
    assert "surface" not in labels(terms)
    assert "dashed" not in drawing.caption
    assert scalars.get_xlim() == (40, 41)


def test_a_history_without_rows_is_not_drawn(result: Result, contents: Contents) -> None:
    with pytest.raises(NothingToDraw, match="no rows"):
        curves.evolution(result, {name: c[:0] for name, c in contents.history.items()})


def test_a_figure_is_always_the_same_bytes(
    result: Result, contents: Contents, tmp_path: Path
) -> None:
    """Whatever the settings of the process, such as those of a notebook."""
    before = dict(mpl.rcParams)
    style.save(curves.inertial_number(result, contents.fields).figure, tmp_path / "a.png")
    assert dict(mpl.rcParams) == before
    other = {"savefig.bbox": "tight", "savefig.transparent": True, "xtick.major.size": 9}
    with mpl.rc_context(other | {"font.size": 20, "axes.grid": True}):  # type: ignore[arg-type]
        style.save(curves.inertial_number(result, contents.fields).figure, tmp_path / "b.png")
    content = (tmp_path / "a.png").read_bytes()
    assert content == (tmp_path / "b.png").read_bytes()
    assert b"Software" not in content
    assert plt.imread(tmp_path / "a.png").shape[:2] == (3.0 * 150, 6.6 * 150)


def test_figures_are_not_kept_by_pyplot(result: Result, contents: Contents) -> None:
    curves.friction_law(result, contents.fields)
    assert plt.get_fignums() == []


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("1", "$p$"),
        (None, "$p$ [units of the file]"),
        ("m/s", "$p$ [m/s]"),
        (r"$\nonsense$", r"$p$ [\$\nonsense\$]"),
    ],
)
def test_labels_name_the_unit(unit: str | None, expected: str, tmp_path: Path) -> None:
    assert style.label("$p$", unit) == expected
    figure = style.new_figure(1.0)
    figure.subplots().set_xlabel(style.label("$p$", unit))
    style.save(figure, tmp_path / "label.png")  # a formula that makes no sense would raise


@pytest.mark.parametrize(("file", "absent"), [("fields", "friction_law"), ("history", "evolution")])
def test_every_figure_is_drawn_or_said_to_be_missing(
    contents: Contents, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, absent: str
) -> None:
    two = {name: album.FIGURES[name] for name in ("friction_law", "evolution")}
    monkeypatch.setattr(album, "FIGURES", two)
    (tmp_path / f"{absent}.png").write_bytes(b"of an earlier run")
    bare = contents._replace(result=replace(contents.result, simulated_pressure=None))
    pictures, missing = album.draw_all(album.Source(*bare, 8)._replace(**{file: None}), tmp_path)
    assert {p.path for p in pictures} == set(tmp_path.iterdir())
    assert [(m.title, m.reason.split(".")[0]) for m in missing] == [
        (two[absent][0], f"there is no {file}")
    ]


def nothing_to_draw(contents: Contents, fields: Fields, folder: Path) -> set[str]:
    """Why none of the figures that need fields was drawn."""
    pictures, missing = album.draw_all(album.Source(contents.result, fields, None, 8), folder)
    assert pictures == []
    return {m.reason for m in missing} - {"there is no history.csv that can be read"}


def test_fields_that_lack_a_variable_are_not_drawn(contents: Contents, tmp_path: Path) -> None:
    fields = with_values(contents.fields, eta=None, I=None)
    assert nothing_to_draw(contents, fields, tmp_path) == {"fields.h5 lacks I, eta"}


def test_fields_that_end_at_the_start_are_not_drawn(contents: Contents, tmp_path: Path) -> None:
    fields = replace(contents.fields, t=contents.fields.t - 1.0)
    (reason,) = nothing_to_draw(contents, fields, tmp_path)
    assert reason == "fields.h5 has no grid point inside the grains after the start"
