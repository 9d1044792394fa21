"""The friction law, the inertial numbers behind it, and the course of the training."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from granpinn.arrays import Floats
from granpinn.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    YELLOW,
    Drawing,
    NothingToDraw,
    new_figure,
    styled,
)
from granpinn.identification.scoring import after_start, flowing
from granpinn.physics.laws import LAWS, mu_of_i
from granpinn.physics.terms import NAMES
from granpinn.results import Fields, Result
from granpinn.results.summary import half_width, true_theta

I_EDGES = np.logspace(-4, 1, 51).tolist()  # below, a law is flat; above, there are few points
COLORS = (BLUE, SKY, ORANGE, GREEN, PURPLE, YELLOW, GREY)  # of the terms of the loss, in order
PARAMETER_COLORS = (BLUE, ORANGE, GREEN, PURPLE)  # of the identified parameters, in order


@styled
def friction_law(result: Result, fields: Fields) -> Drawing:
    """The law, identified and true, over the I that the data cover; the share of each I below."""
    if result.inertial_number is None:
        raise NothingToDraw("the band of the inertial number that the data cover is not known")
    lowest = max(result.inertial_number.q05, I_EDGES[0])
    I = np.geomspace(lowest, max(result.inertial_number.q95, 2 * lowest), 300)  # noqa: E741
    law, truth = LAWS[result.law], true_theta(result)
    figure = new_figure(5.4)
    curve, histogram = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
    caption = "Friction law over the inertial numbers of 5 % to 95 % of the grain points"

    mu = law.friction(I, *result.theta)
    curve.plot(I, mu, color=BLUE, lw=2.2, label="identified", zorder=3)
    if result.covariance is not None:
        half = half_width(I, result, result.covariance)
        curve.fill_between(
            I, np.maximum(mu - half, 0), mu + half, color=BLUE, alpha=0.2, lw=0, label="90 % band"
        )
    if truth is not None:
        true = law.friction(I, *truth)
        curve.plot(I, true, color=BLACK, lw=1.4, ls=(0, (4, 3)), label="true", zorder=4)
        caption += ", against the law that generated the data"
    curve.set_ylabel(r"$\mu(I)$")
    curve.set_title(f"(a) friction law: {law.title}")
    curve.legend(loc="upper left")
    curve.grid(True)
    _histogram_of_I(histogram, fields)
    histogram.set_title("(b) share of the grain points")
    return Drawing(figure, f"{caption}. {_share_below(fields)}")


@styled
def inertial_number(result: Result, fields: Fields) -> Drawing:
    """Histogram of I in the grains, with the median and I0 of mu(I)."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    _histogram_of_I(axes, fields)
    caption = f"Inertial number in the grains. {_share_below(fields)}"
    if result.law == mu_of_i.LAW.name:
        I_0 = result.parameters.I0.value
        axes.axvline(I_0, color=BLACK, lw=1.2, ls=(0, (4, 3)), label=f"$I_0$ = {I_0:.3g}")
        caption += " The data determine mu_2 only where I comes near I0."
    median = float(np.median(fields.values["I"][after_start(fields)]))
    if median > I_EDGES[0]:
        axes.axvline(median, color=ORANGE, lw=1.2, label=f"median {median:.2g}")
    axes.legend()
    return Drawing(figure, caption)


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
def evolution(result: Result, history: Mapping[str, Floats]) -> Drawing:
    """The identified parameters and the terms of the loss against the step."""
    step = history["step"]
    if step.size == 0:
        raise NothingToDraw("history.csv has no rows")
    figure = new_figure(5.6)
    scalars, terms = figure.subplots(2, 1, sharex=True)
    law = LAWS[result.law]
    for name, color in zip(law.free, itertools.cycle(PARAMETER_COLORS), strict=False):
        symbol = f"${law.parameter(name).symbol}$"
        scalars.plot(step, history[name], color=color, label=symbol)
        true = getattr(result.truth, name, None)
        if true is not None:
            scalars.axhline(true, color=color, lw=1.2, ls=(0, (4, 3)), label=f"{symbol} true")
    scalars.set_ylabel("friction coefficient")
    scalars.set_title("(a) identified parameters")
    scalars.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    lines = [("loss", BLACK), *zip(NAMES, itertools.cycle(COLORS), strict=False)]
    for name, color in lines:
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
