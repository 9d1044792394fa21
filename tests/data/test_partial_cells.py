"""Partly filled cells under the free surface count as full."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, with_partial_cells
from granpinn.data.flow import Surface
from tests.data.test_particles import FLOW as SCATTERED
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


def test_a_cell_without_a_vector_or_a_line_stays() -> None:
    flow = layer()
    flow.u[0, 3, 0] = np.nan
    assert full(flow)[3] == T * X - 1
    assert flow.surface is not None
    later = flow.surface.t > flow.t[0]
    surface = replace(flow.surface, **{k: getattr(flow.surface, k)[later] for k in ("t", "x", "y")})
    assert full(replace(flow, surface=surface))[3] == (T - 1) * X


def test_without_a_line_cells_that_are_half_full_count() -> None:
    assert full(replace(layer(), surface=None)) == [T * X] * 4 + [0, 0]


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


def test_cells_of_a_solver_and_scattered_vectors_stay() -> None:
    solver = layer(attributes={"grid_spacing_of_solver": 1.0})
    assert with_partial_cells(solver) is solver
    assert with_partial_cells(SCATTERED) is SCATTERED
