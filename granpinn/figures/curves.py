"""The friction law, the inertial numbers behind it, and the course of the training."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, PercentFormatter

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
from granpinn.physics.laws import LAWS
from granpinn.physics.terms import NAMES
from granpinn.results import Fields, Result
from granpinn.results.fields import after_start, flowing
from granpinn.results.parameters import NOT_DETERMINED
from granpinn.results.records import StressPoints
from granpinn.results.result import true_friction

I_EDGES = np.logspace(-4, 1, 51).tolist()  # below, a law is flat; above, there are few points
COLORS = (BLUE, SKY, ORANGE, GREEN, PURPLE, YELLOW, GREY)  # of the terms of the loss, in order
LAW_COLORS = (ORANGE, GREEN, PURPLE, SKY, YELLOW)  # of the laws of a comparison, in its order
PARAMETER_COLORS = (BLUE, ORANGE, GREEN, PURPLE)  # of the identified parameters, in order


@styled
def friction_law(result: Result, fields: Fields | None) -> Drawing:
    """The law with its band, the points of the fit and the true law; the share of each I below.

    Of a law of several flows, the range of I of each flow is below.
    """
    figure = new_figure(4.6 if fields is None else 5.4)
    curve, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
    caption = draw_law(curve, result)
    curve.set_title(f"(a) friction law: {result.friction_law.title}")
    below.set_xlabel("inertial number $I$")
    if fields is None:
        for k, flow in enumerate(result.flows):
            if flow.I_range is not None:
                below.plot(flow.I_range, (k, k), color=BLUE, lw=4)
        below.set_yticks(range(len(result.flows)), [flow.input.name for flow in result.flows])
        below.set_ylim(len(result.flows) - 0.5, -0.5)
        below.set_title("(b) inertial numbers of each flow")
        caption += ", and the I of each flow"
    else:
        _histogram_of_I(below, fields)
        below.set_title("(b) share of the grain points")
    low, high = _over_the_data(curve, result)
    if fields is not None:
        I = fields.values["I"][after_start(fields)]
        beyond = np.mean((low > I) | (high < I))
        caption += f". {100 * beyond:.0f} % of all points lie beside the axis"
    return Drawing(figure, f"{caption}. The axis of mu does not begin at 0.")


def _over_the_data(axes: Axes, result: Result) -> tuple[float, float]:
    """Let the axis of I cover the I of the law and its points alone; its ends."""
    points = result.law.points
    covered = (*(result.law.I_range or ()), *(points.I if points else ()))
    margin = 1.1 * (max(covered) / min(covered)) ** 0.03
    low, high = min(covered) / margin, max(covered) * margin
    axes.set_xlim(low, high)
    return low, high


def draw_law(curve: Axes, result: Result) -> str:
    """The law with its band, the points of the fit and the true law on one panel; its caption."""
    found = result.law
    if found.I_range is None:
        raise NothingToDraw(f"the range of I is not known: {found.reason or 'an earlier version'}")
    low, high = found.I_range
    caption = f"Over the I of 5 % to 95 % of the grains that shear, {low:.2g} to "
    caption += f"{high:.2g}"
    if found.points is not None:
        caption += _stress_points(curve, found.points, result.form)
    I = np.geomspace(low, high, 2) if found.curve is None else np.array(found.curve.I)
    if found.curve is not None:
        curve.plot(I, found.curve.mu, color=BLUE, lw=2.2, label="identified", zorder=3)
        if found.curve.low is not None and found.curve.high is not None:
            ends = found.curve.low, found.curve.high
            known = [found.curve.determines(k) for k in range(len(I))]
            band = curve.fill_between(I, *ends, where=known, color=BLUE, alpha=0.2, lw=0)
            band.set_label("90 % band")
            if not all(known):
                caption += f". Where there is no band, mu(I) is {NOT_DETERMINED}"
    if (compared := result.checks.get("comparison_of_laws")) is not None:
        others = [c for c in compared.laws if c.law != result.law.name]
        caption += _compared(curve, others, I)
    if (true := true_friction(result, I)) is not None:
        curve.plot(I, true, color=BLACK, lw=1.4, ls=(0, (4, 3)), label="true", zorder=4)
        caption += ", against the law that generated the data"
    if found.reason is not None:
        what = "curve" if found.curve is None else "90 % band"
        caption += f". The {what} is {NOT_DETERMINED}: {found.reason}"
    curve.set_xscale("log")
    curve.xaxis.set_minor_locator(LogLocator(subs=(2, 5)))
    curve.set_ylabel(r"$\mu(I)$")
    if curve.get_legend_handles_labels()[1]:
        curve.legend(loc="upper left")
    curve.grid(True)
    return caption


def _compared(axes: Axes, others: Sequence[Any], I: Floats) -> str:
    """Draw the other laws of the comparison; words for the caption."""
    for c, color in zip(others, itertools.cycle(LAW_COLORS), strict=False):
        law = LAWS[c.law]
        mu = law.friction(I, *(c.parameters[name].value for name in law.names)) + 0 * I
        axes.plot(I, mu, color=color, lw=1.0, label=law.title, zorder=2.5)
    return ", and the laws of the comparison as they are nearest to the free curve"


def _stress_points(axes: Axes, points: StressPoints, form: str) -> str:
    """Draw the points behind the law; words for the caption."""
    mu = np.array(points.mu)
    spread = np.stack([mu - points.low, np.array(points.high) - mu])
    axes.errorbar(
        points.I,
        mu,
        yerr=spread,
        fmt="o",
        ms=3.5,
        color=GREY,
        elinewidth=0.9,
        label=r"$|\tau|/p$ of the fit",
        zorder=2,
    )
    words = ", with median and 16 % to 84 % of the stress ratio of the fit"
    return words + (", which is that of the law by construction" if form == "strong" else "")


def _histogram_of_I(axes: Axes, fields: Fields) -> None:
    counted = after_start(fields)
    I, moving = fields.values["I"][counted], flowing(fields)[counted]
    share = np.full(I.size, 1.0 / I.size)
    # One outline: fifty bars take longer to lay out than the rest of the figure.
    axes.hist(
        I,
        I_EDGES,
        weights=share,
        histtype="stepfilled",
        lw=0,
        color=SKY,
        alpha=0.6,
        label="all grains",
    )
    axes.hist(
        I[moving], I_EDGES, weights=share[moving], histtype="step", color=BLUE, label="flowing"
    )
    axes.set_xscale("log")
    axes.xaxis.set_minor_locator(LogLocator(subs=(2, 5)))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.legend(loc="upper left")


@styled
def evolution(result: Result, history: Mapping[str, Floats]) -> Drawing:
    """The identified parameters and the terms of the loss against the step."""
    figure = new_figure(5.6)
    scalars, terms = figure.subplots(2, 1, sharex=True)
    draw_evolution(scalars, terms, result, history)
    scalars.set_title("(a) identified parameters")
    terms.set_title("(b) loss and its terms before weighting")
    return Drawing(
        figure,
        "The identified parameters"
        + (" with their true values (dashed)" if result.truth is not None else "")
        + ", and the loss with its terms.",
    )


def draw_evolution(
    scalars: Axes, terms: Axes, result: Result, history: Mapping[str, Floats]
) -> None:
    """The same on two panels, for the parameters and for the terms."""
    step = history["step"]
    if step.size == 0:
        raise NothingToDraw("history.csv has no rows")
    law = result.friction_law
    for name, color in zip(law.free, itertools.cycle(PARAMETER_COLORS), strict=False):
        symbol = f"${law.parameter(name).symbol}$"
        scalars.plot(step, history[name], color=color, label=symbol)
        true = getattr(result.truth, name, None)
        if true is not None:
            scalars.axhline(true, color=color, lw=1.2, ls=(0, (4, 3)), label=f"{symbol} true")
    scalars.set_ylabel("friction coefficient")
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
    terms.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in (scalars, terms):
        axes.grid(True)
        axes.set_xlim(step.min(), max(step.max(), step.min() + 1))
