"""Partly filled cells under the free surface count as full."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_the_line_is_above_against_gravity(turns: int) -> None:
    flow = layer()
    assert flow.surface is not None
    (x, y), (g_x, g_y), line = (flow.x, flow.y), flow.gravity, (flow.surface.x, flow.surface.y)
    fields = {name: getattr(flow, name) for name in ("u", "v", "c")}
    for _ in range(turns):  # counterclockwise by a right angle
        x, y = -y[::-1], x
        g_x, g_y = -g_y, g_x
        line = (-line[1], line[0])
        fields = {name: np.swapaxes(a, 1, 2)[:, :, ::-1] for name, a in fields.items()}
    surface = replace(flow.surface, x=line[0], y=line[1])
    turned = replace(flow, x=x, y=y, gravity=(g_x, g_y), surface=surface, **fields)
    assert int((with_partial_cells(turned).c == 1).sum()) == 4 * T * X


@pytest.mark.parametrize("turned", [False, True])
def test_a_line_that_folds(turned: bool) -> None:
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
    gravity = (0.0, -1.0)
    if turned:
        c, u, inside = (a.swapaxes(-1, -2) for a in (c, u, inside))
        line_x, line_y, gravity = line_y, line_x, (-1.0, 0.0)
    flow = make_flow(frames=1, rows=n, columns=n)
    surface = Surface(np.full(line_x.size, flow.t[0]), line_x, line_y)
    flow = replace(
        flow, y=y, x=x, u=u, v=u, c=c, p=None, surface=surface, gravity=gravity, grain_diameter=1.0
    )
    found = with_partial_cells(flow).material[0]
    # Where circle and layer meet, a point of the one is nearest to cells of the other.
    clear = np.abs(far - radius) > 0.1 if not turned else np.abs(far.T - radius) > 0.1
    wrong = (found != inside) & clear
    assert wrong.sum() <= 2
    assert inside[~flow.material[0]].sum() > 50
