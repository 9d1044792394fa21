"""The final states of simulated collapses (the paper's figure 3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize

from granpinn.arrays import Floats
from granpinn.data.flow import Flow, Truth
from granpinn.figures.style import BLACK, VALUE_MAP, Drawing, label, new_figure, save, styled

LARGEST_SHARE = 0.95  # quantile of D2 at which the colours of the final states end


def strain_rate(flow: Flow, k: int) -> Floats:
    """D2 = sqrt(D:D) at frame k [Y, X] by central differences; NaN beside the surface."""
    u_y, u_x = np.gradient(flow.u[k].astype(np.float64), flow.y, flow.x)
    v_y, v_x = np.gradient(flow.v[k].astype(np.float64), flow.y, flow.x)
    result: Floats = np.sqrt(u_x**2 + v_y**2 + 0.5 * (u_y + v_x) ** 2)
    return result


def save_final_states(flows: Sequence[Flow], path: Path) -> Path:
    save(final_states(flows).figure, path)
    return path


@styled
def final_states(flows: Sequence[Flow]) -> Drawing:
    """Last frames of several collapses, coloured by D2; one row per first parameter of the law."""
    rows = sorted({_first_parameter(flow) for flow in flows})
    members = [[f for f in flows if _first_parameter(f) == value] for value in rows]
    width = max(float(flow.x[-1]) for flow in flows)
    height = max(_top(flow, len(flow.t) - 1) for flow in flows)
    columns = max(map(len, members))
    figure = new_figure(len(rows) * (3.0 * columns * height / width / columns + 0.55) + 0.6)
    panels = figure.subplots(len(rows), columns, squeeze=False, sharex=True, sharey=True)
    last = [strain_rate(flow, len(flow.t) - 1) for flow in flows]
    norm = Normalize(
        0, float(np.nanquantile(np.concatenate([d.ravel() for d in last]), LARGEST_SHARE))
    )
    for axes_row, row in zip(panels, members, strict=True):
        for axes in axes_row[len(row) :]:
            axes.set_axis_off()
        for axes, flow in zip(axes_row, row, strict=False):
            _map(axes, flow, len(flow.t) - 1, strain_rate(flow, len(flow.t) - 1), norm)
            axes.set_xlim(0, width)
            axes.set_ylim(0, 1.1 * height)
            axes.set_title(_law_text(flow))
            _name_axes(axes, flow)
            axes.label_outer()
    mappable = ScalarMappable(norm, colormaps[VALUE_MAP])
    figure.colorbar(mappable, ax=list(panels.ravel()), label="$D_2$", extend="max", aspect=40)
    return Drawing(figure, "Final states, coloured by the strain rate $D_2$; the line is c = 0.5.")


def _first_parameter(flow: Flow) -> float:
    """First parameter of the friction law of the flow, such as mu_s; 0 if unknown."""
    return (flow.truth.theta[0] if flow.truth else None) or 0.0


def _law_text(flow: Flow) -> str:
    """The free parameters of the friction law of the flow, such as mu_s and mu_2."""
    truth = flow.truth or Truth()
    law = truth.friction_law
    pairs = ((law.parameter(name).symbol, getattr(truth, name)) for name in law.free)
    return ", ".join(f"${symbol} = {value:g}$" for symbol, value in pairs if value is not None)


def _top(flow: Flow, k: int) -> float:
    """Height of the grains at frame k."""
    rows = np.flatnonzero((flow.c[k] > 0.5).any(axis=1))
    return float(flow.y[rows[-1]]) if rows.size else float(flow.y[0])


def _map(axes: Axes, flow: Flow, k: int, values: Floats, norm: Normalize) -> QuadMesh:
    cut = np.ma.masked_invalid(values)
    mesh = axes.pcolormesh(flow.x, flow.y, cut, norm=norm, cmap=VALUE_MAP, shading="nearest")
    _surface_line(axes, flow, k, BLACK, 0.7)
    axes.set_aspect("equal")
    return mesh


def _surface_line(axes: Axes, flow: Flow, k: int, color: object, width: float) -> None:
    # A row of air around the grid closes the line where the grains reach its edge.
    c = np.pad(flow.c[k], ((0, 1), (0, 1)))
    x = np.append(flow.x, 2 * flow.x[-1] - flow.x[-2])
    y = np.append(flow.y, 2 * flow.y[-1] - flow.y[-2])
    axes.contour(x, y, c, levels=[0.5], colors=[color], linewidths=width)


def _name_axes(axes: Axes, flow: Flow) -> None:
    axes.set_xlabel(label("$x$", flow.length_unit))
    axes.set_ylabel(label("$y$", flow.length_unit))
