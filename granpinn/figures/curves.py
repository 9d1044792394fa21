"""The friction law, the inertial numbers behind it, and the course of the training."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from granpinn.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    Drawing,
    NothingToDraw,
    new_figure,
    styled,
)
from granpinn.identification.scoring import after_start, flowing
from granpinn.results import Fields, Result
from granpinn.results.summary import friction, half_width

Array = npt.NDArray[np.floating]

I_EDGES = np.logspace(-4, 1, 51).tolist()  # mu(I) is flat below, and few points lie above
TERM_COLORS = {
    "loss": BLACK,
    "velocity": BLUE,
    "surface": SKY,
    "momentum": ORANGE,
    "continuity": GREEN,
    "constitutive": PURPLE,
}


@styled
def friction_law(result: Result, fields: Fields) -> Drawing:
    """mu(I), identified and true, over the I that the data cover; the share of each I below."""
    if result.inertial_number is None:
        raise NothingToDraw("the band of the inertial number that the data cover is not known")
    lowest = max(result.inertial_number.q05, I_EDGES[0])
    I = np.geomspace(lowest, max(result.inertial_number.q95, 2 * lowest), 300)  # noqa: E741
    p = result.parameters
    figure = new_figure(5.4)
    law, histogram = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
    caption = "Friction law over the inertial numbers of 5 % to 95 % of the grain points"

    mu = friction(I, p.mu_s.value, p.mu_2.value, p.I0.value)
    law.plot(I, mu, color=BLUE, lw=2.2, label="identified", zorder=3)
    if result.covariance is not None:
        half = half_width(I, result, result.covariance)
        law.fill_between(
            I, np.maximum(mu - half, 0), mu + half, color=BLUE, alpha=0.2, lw=0, label="90 % band"
        )
    truth = result.truth
    if truth is not None and truth.mu_s is not None and truth.mu_2 is not None:
        true = friction(I, truth.mu_s, truth.mu_2, truth.I0 or p.I0.value)
        law.plot(I, true, color=BLACK, lw=1.4, ls=(0, (4, 3)), label="true", zorder=4)
        caption += ", against the law that generated the data"
    law.set_ylabel(r"$\mu(I)$")
    law.set_title("(a) friction law")
    law.legend(loc="upper left")
    law.grid(True)
    _histogram_of_I(histogram, fields)
    histogram.set_title("(b) share of the grain points")
    return Drawing(figure, f"{caption}. {_share_below(fields)}")


@styled
def inertial_number(result: Result, fields: Fields) -> Drawing:
    """Histogram of I in the grains, with I0 and the median."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    _histogram_of_I(axes, fields)
    I_0 = result.parameters.I0.value
    axes.axvline(I_0, color=BLACK, lw=1.2, ls=(0, (4, 3)), label=f"$I_0$ = {I_0:.3g}")
    median = float(np.median(fields.values["I"][after_start(fields)]))
    if median > I_EDGES[0]:
        axes.axvline(median, color=ORANGE, lw=1.2, label=f"median {median:.2g}")
    axes.legend()
    return Drawing(
        figure,
        f"Inertial number in the grains. {_share_below(fields)} "
        "mu_2 is seen only as far as I comes near I0.",
    )


def _histogram_of_I(axes: Axes, fields: Fields) -> None:
    counted = after_start(fields)
    I, moving = fields.values["I"][counted], flowing(fields)[counted]  # noqa: E741
    share = np.full(I.size, 1.0 / I.size)
    axes.hist(I, I_EDGES, weights=share, color=SKY, alpha=0.6, label="all grains")
    axes.hist(
        I[moving], I_EDGES, weights=share[moving], histtype="step", color=BLUE, label="flowing"
    )
    axes.set_xscale("log")
    axes.set_xlabel("inertial number $I$")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.legend(loc="upper left")


def _share_below(fields: Fields) -> str:
    below = np.mean(fields.values["I"][after_start(fields)] < I_EDGES[0])
    return f"{100 * below:.0f} % of the points have I below {I_EDGES[0]:g} (not drawn)."


@styled
def evolution(result: Result, history: Mapping[str, Array]) -> Drawing:
    """mu_s, mu_2 and the terms of the loss against the step."""
    step = history["step"]
    if step.size == 0:
        raise NothingToDraw("history.csv has no rows")
    figure = new_figure(5.6)
    scalars, terms = figure.subplots(2, 1, sharex=True)
    for name, symbol, color in (("mu_s", r"$\mu_s$", BLUE), ("mu_2", r"$\mu_2$", ORANGE)):
        scalars.plot(step, history[name], color=color, label=symbol)
        true = getattr(result.truth, name, None)
        if true is not None:
            scalars.axhline(true, color=color, lw=1.2, ls=(0, (4, 3)), label=f"{symbol} true")
    scalars.set_ylabel("friction coefficient")
    scalars.set_title("(a) identified parameters")
    scalars.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for name, color in TERM_COLORS.items():
        value = np.where(history[name] > 0, history[name], np.nan)
        if np.isfinite(value).any():
            wide = 2.0 if name == "loss" else 1.2
            terms.plot(step, value, color=color, lw=wide, label=name)
    terms.set_yscale("log")
    terms.set_xlabel("optimisation step")
    terms.set_ylabel("mean square")
    terms.set_title("(b) loss and its terms before weighting")
    terms.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in (scalars, terms):
        axes.grid(True)
        axes.set_xlim(step.min(), max(step.max(), step.min() + 1))
    return Drawing(
        figure,
        "Course of the training: the identified parameters"
        + (" with their true values (dashed)" if result.truth is not None else "")
        + ", and the loss with its terms.",
    )
