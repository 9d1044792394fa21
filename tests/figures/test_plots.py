"""Curves and the style of all figures: the drawn values equal the values in the run folder."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from granpinn.figures import curves, maps, style
from granpinn.physics.terms import NAMES
from granpinn.results import Result
from tests.figures.drawn import labels, line, shares, xy
from tests.run_folder import Contents, with_values


def test_the_histogram_of_I_counts_every_grain_point_after_the_start(
    result: Result, contents: Contents
) -> None:
    K = contents.fields.index.size
    I = np.geomspace(2e-4, 5, K)
    fields = with_values(contents.fields, I=I, D2=np.where(np.arange(K) < K // 4, 1e3, 0))
    axes = curves.friction_law(result, fields).figure.axes[1]
    assert shares(axes).sum() == pytest.approx(1)
    flowing = np.asarray(axes.patches[-1].get_path().vertices)[:, 1]
    assert 0 < flowing.max() <= shares(axes).max() * (1 + 1e-12)


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
        shown = np.where(history[name] > 0, history[name], np.nan)  # 0 has no logarithm
        np.testing.assert_array_equal(xy(line(terms, name))[1], shown)
    assert np.isnan(history["momentum"][0])  # the pre-fit has no such term


def test_a_figure_is_always_the_same_bytes(
    result: Result, contents: Contents, tmp_path: Path
) -> None:
    """Whatever the settings of the process, such as those of a notebook."""
    before = dict(mpl.rcParams)
    style.save(curves.evolution(result, contents.history).figure, tmp_path / "a.png")
    assert dict(mpl.rcParams) == before
    other = {"savefig.bbox": "tight", "savefig.transparent": True, "xtick.major.size": 9}
    with mpl.rc_context(other | {"font.size": 20, "axes.grid": True}):  # type: ignore[arg-type]
        style.save(curves.evolution(result, contents.history).figure, tmp_path / "b.png")
    content = (tmp_path / "a.png").read_bytes()
    assert content == (tmp_path / "b.png").read_bytes()
    assert b"Software" not in content
    assert plt.imread(tmp_path / "a.png").shape[:2] == (1008, 972)


def test_a_figure_is_drawn_once_with_the_bytes_of_savefig(
    contents: Contents, tmp_path: Path
) -> None:
    """savefig draws everything once more for the layout."""
    memory = BytesIO()
    with mpl.rc_context({**mpl.rcParamsDefault, **style.STYLE}):  # type: ignore[dict-item]
        figure = maps.pressure_fields(contents.fields, None).figure
        figure.savefig(memory, metadata={"Software": None})
    path = tmp_path / "pressure.png"
    style.save(maps.pressure_fields(contents.fields, None).figure, path)
    assert path.read_bytes() == memory.getvalue()


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
