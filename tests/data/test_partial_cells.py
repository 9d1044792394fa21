"""Partly filled cells under the free surface count as full."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from granpinn.data import Flow, with_partial_cells
from granpinn.data.flow import Surface
from tests.flows import make_flow

T, Y, X = 3, 6, 5
LINE = 4.2  # between the centers of rows 3 and 4 of height 1


def layer(**changes: object) -> Flow:
    """Rows 0 to 2 full, rows 3 and 4 partly filled, with vectors in all of them."""
    flow = make_flow(frames=T, rows=Y, columns=X)
    y, x = np.arange(Y) + 0.5, np.arange(X) + 0.5
    c = np.zeros((T, Y, X), np.float32)
    c[:, :3], c[:, 3], c[:, 4] = 1, 0.7, 0.2
    u = np.where(c > 0, 1.0, np.nan).astype(np.float32)
    t, along = (a.ravel() for a in np.meshgrid(flow.t, x, indexing="ij"))
    line = Surface(t, along, np.full(t.size, LINE), None)
    return replace(flow, y=y, x=x, u=u, v=u, c=c, p=None, surface=line, **changes)


def full(flow: Flow) -> list[int]:
    """Full cells of every row, over all frames."""
    return [int(n) for n in (with_partial_cells(flow).c == 1).sum(axis=(0, 2))]


def test_cells_with_their_center_below_the_line_are_full() -> None:
    assert full(layer()) == [T * X] * 4 + [0, 0]


def test_a_line_that_folds() -> None:
    """A wave that breaks: grains within a circle over a layer, so that the line overhangs.

    Cells with their center inside are grains, whatever the order of the points of the line.
    """
    n, center, radius = 40, (20.0, 18.0), 8.3
    x = y = np.arange(n) + 0.5
    far = np.hypot(x - center[0], y[:, None] - center[1])
    inside = (far < radius) | (y[:, None] < 12.2)
    deep = (far < radius - 1.5) | (y[:, None] < 11)
    near = (far < radius + 1.5) | (y[:, None] < 13)
    c = np.where(deep, 1.0, np.where(near, 0.5, 0.0)).astype(np.float32)[None]
    angle = np.random.default_rng(3).permutation(np.linspace(-0.24 * np.pi, 1.24 * np.pi, 200))
    line_x, line_y = center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)
    flat = np.concatenate([np.arange(0, 14.2, 0.3), np.arange(26, 40, 0.3)])
    line_x, line_y = np.append(line_x, flat), np.append(line_y, np.full(flat.size, 12.2))
    u = np.where(c > 0, 1.0, np.nan).astype(np.float32)
    flow = make_flow(frames=1, rows=n, columns=n)
    surface = Surface(np.full(line_x.size, flow.t[0]), line_x, line_y)
    flow = replace(
        flow,
        y=y,
        x=x,
        u=u,
        v=u,
        c=c,
        p=None,
        surface=surface,
        gravity=(0.0, -1.0),
        grain_diameter=1.0,
    )
    found = with_partial_cells(flow).material[0]
    # Where circle and layer meet, a point of the one is nearest to cells of the other.
    clear = np.abs(far - radius) > 0.1
    wrong = (found != inside) & clear
    assert wrong.sum() <= 2
    assert inside[~flow.material[0]].sum() > 50
