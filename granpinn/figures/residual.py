"""The momentum residual of a run, where grains shear: its map and its shares."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.ticker import PercentFormatter

from granpinn.figures.maps import (
    Window,
    aspect_of,
    draw_map,
    grain_window,
    label_axes,
    stacked_height,
)
from granpinn.figures.style import (
    BLACK,
    ORANGE,
    SKY,
    Drawing,
    NothingToDraw,
    new_figure,
    styled,
)
from granpinn.results import Fields
from granpinn.results.fields import D2_STAGNANT, shearing

RESIDUALS = ("momentum_residual_x", "momentum_residual_y")
RESIDUAL_LABEL = r"$|e| / (\rho |g|)$"
RESTING = "#cccccc"
RESIDUAL_EDGES = np.logspace(-5, 3, 65).tolist()
RESIDUAL_RANGE = (1e-3, 1e1)  # of the map


@styled
def momentum_residual(fields: Fields, k: int) -> Drawing:
    """Map at one time and histogram over all times of |e| / (rho |g|), strong form."""
    window = grain_window(fields, k)
    aspect = aspect_of(fields, window)
    if height := stacked_height(aspect):
        figure = new_figure(height + 3.0)
        field_map, histogram = figure.subplots(2, 1, height_ratios=(height, 2.0))
    else:
        figure = new_figure(4.2)
        field_map, histogram = figure.subplots(1, 2)
    draw_residual(field_map, fields, window)
    field_map.set_title(f"(a) t = {fields.t[k]:.3g}")

    counted = shearing(fields)
    size = np.hypot(*(fields.values[name][counted] for name in RESIDUALS))
    size = size[np.isfinite(size)]
    if size.size == 0:
        raise NothingToDraw("the momentum residual is not finite where grains shear")
    median, high = np.quantile(size, (0.5, 0.95))
    share = np.full(size.size, 1 / size.size)
    histogram.hist(size, RESIDUAL_EDGES, weights=share, color=SKY, histtype="stepfilled", lw=0)
    histogram.axvline(median, color=BLACK, lw=1.2, label=f"median {median:.2g}")
    histogram.axvline(high, color=ORANGE, lw=1.2, label=f"95 % below {high:.2g}")
    histogram.set_xscale("log")
    histogram.set_xlabel(RESIDUAL_LABEL)
    histogram.set_title("(b) share of points")
    histogram.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    histogram.margins(y=0.3)  # for the legend above the bars
    histogram.legend(loc="upper right")
    return Drawing(
        figure,
        "Momentum residual of the strong form (second derivatives of the network, eta of the"
        f" identified law), in units of the weight: (a) at t = {fields.t[k]:.3g}, (b) at all"
        " times. Grey: grains at rest, where the motion does not determine the stress.",
    )


def draw_residual(axes: Axes, fields: Fields, window: Window) -> None:
    """The map of |e| / (rho |g|) alone, where grains shear; grains at rest are grey."""
    size = np.hypot(*(fields.frame(name, window.k) for name in RESIDUALS))
    moves = fields.frame("D2", window.k) * fields.time >= D2_STAGNANT
    x, y = fields.x[window.columns], fields.y[window.rows]
    rest = np.ma.masked_where(moves | ~np.isfinite(size), np.zeros(size.shape))
    cut = rest[window.rows, window.columns]
    axes.pcolormesh(x, y, cut, cmap=ListedColormap([RESTING]), shading="nearest", rasterized=True)
    size = np.where(moves, size, np.nan)
    norm = LogNorm(*RESIDUAL_RANGE)
    draw_map(axes, fields, window, size, norm, "cividis", RESIDUAL_LABEL, extend="both")
    label_axes(axes, fields)
