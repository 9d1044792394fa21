"""Figures of an inspection: valid vectors, speed, inertial numbers, noise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from granpinn.arrays import Float64
from granpinn.figures.style import (
    BLACK,
    BLUE,
    ORANGE,
    SKY,
    VALUE_MAP,
    WIDTH,
    Drawing,
    label,
    new_figure,
    save,
    styled,
)
from granpinn.inspection.inspection import Inspection

I_EDGES = np.logspace(-4, 1, 51)


@styled
def validity(found: Inspection) -> Drawing:
    """Share of valid vectors in every cell, among the frames in which it is full of grains."""
    view = found.view
    grains = view.grains.sum(axis=0)
    there = (view.there & view.grains).sum(axis=0)
    share = np.divide(there, grains, out=np.full(grains.shape, np.nan), where=grains > 0)
    return _map(found, share, "share of valid vectors", (0.0, 1.0))


@styled
def speed(found: Inspection) -> Drawing:
    """The speed in the frame with the largest mean speed."""
    view = found.view
    size = np.where(view.there, np.hypot(view.u, view.v), np.nan) * found.scales.velocity
    n = view.there.sum(axis=(1, 2))
    mean = np.divide(np.nansum(size, axis=(1, 2)), n, out=np.zeros(n.size), where=n > 0)
    k = int(np.argmax(mean))
    drawing = _map(found, size[k], label("$|v|$", _velocity_unit(found)))
    drawing.figure.axes[0].set_title(f"t = {found.flow.t[k]:.4g}")
    return drawing


@styled
def noise(found: Inspection) -> Drawing:
    """The noise of one component, cell by cell."""
    values = found.noise_cells * found.scales.velocity
    return _map(found, values, label(r"$\sigma$", _velocity_unit(found)))


@styled
def inertia(found: Inspection) -> Drawing:
    """The assumed friction law, that of the momentum balance, and I of the flowing vectors."""
    figure = new_figure(4.6)
    law_axes, axes = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1))
    law = found.law
    I = np.geomspace(I_EDGES[0], I_EDGES[-1], 300)
    mu = law.friction_law.friction(I, *law.theta)
    law_axes.plot(I, mu, color=BLUE, label=r"$\mu(I)$ assumed")
    if found.inertia is not None:
        law_axes.axvspan(found.inertia.q05, found.inertia.q95, color=SKY, alpha=0.3, lw=0)
    scale = law.inertial_scale
    if scale is not None:
        law_axes.axvline(scale, color=BLACK, ls=(0, (4, 3)), lw=1.2, label=f"$I_0$ = {scale:g}")
        axes.axvline(scale / 3, color=ORANGE, lw=1.2, label="$I_0/3$")
        axes.legend()
    points = found.baseline.points if found.baseline.reason is None else ()
    if points:
        law_axes.errorbar(
            [p.I for p in points],
            [p.mu for p in points],
            [p.se for p in points],
            fmt="o",
            ms=3,
            color=ORANGE,
            label="momentum balance",
        )
    law_axes.set_ylabel(r"$\mu(I)$")
    law_axes.legend(loc="upper left")
    law_axes.set_title("(a) covered by 5 to 95 % of the flowing vectors")
    weights = found.gradients.vectors[found.flows]
    if weights.size:
        share = weights / weights.sum()
        axes.hist(found.I[found.flows], I_EDGES.tolist(), weights=share, color=SKY)
    axes.set_xscale("log")
    axes.set_xlabel("inertial number $I$, hydrostatic pressure below the surface")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_title("(b) share of the flowing vectors")
    return Drawing(figure, "Inertial numbers that the data cover.")


FIGURES: dict[str, Callable[[Inspection], Drawing]] = {
    "validity": validity,
    "speed": speed,
    "inertial_number": inertia,
    "noise": noise,
}


def save_figures(found: Inspection, folder: Path) -> list[Path]:
    """Writes every figure to `folder` and returns their paths."""
    paths = []
    for name, draw in FIGURES.items():
        paths.append(folder / f"{name}.png")
        save(draw(found).figure, paths[-1])
    return paths


def _velocity_unit(found: Inspection) -> str:
    flow = found.flow
    return "1" if flow.length_unit == "1" else f"{flow.length_unit}/{flow.time_unit}"


def _map(
    found: Inspection, values: Float64, text: str, limits: tuple[float, float] | None = None
) -> Drawing:
    """One field [Y, X] over the grid of the flow."""
    flow = found.flow
    aspect = float(np.ptp(flow.y) / np.ptp(flow.x))
    figure = new_figure(float(np.clip((WIDTH - 1.6) * aspect + 0.7, 2.4, 7.0)))
    axes: Axes = figure.subplots()
    finite = values[np.isfinite(values)]
    if limits is None:
        limits = (0.0, float(np.quantile(finite, 0.998)) if finite.size else 1.0)
    image = axes.pcolormesh(
        flow.x,
        flow.y,
        np.ma.masked_invalid(values),
        vmin=limits[0],
        vmax=limits[1] or 1.0,
        cmap=VALUE_MAP,
        shading="nearest",
    )
    axes.set_aspect("equal")
    axes.set_xlabel(label("$x$", flow.length_unit))
    axes.set_ylabel(label("$y$", flow.length_unit))
    figure.colorbar(image, ax=axes, label=text, pad=0.02)
    return Drawing(figure, text)
