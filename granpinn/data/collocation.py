"""Where the equations are asked for beside the data: points between the vectors of a grid.

Equations that are asked for at the vectors alone are overfitted there: in the layer over the
ground, thinner than the spacing of the vectors, a trained network left 2 to 6 g of momentum between
the lowest two rows and 0.1 g at them (docs/method.md, section 8). So the network has to follow them
at random places and times between the vectors too; but neither in the lowest row nor between it and
the next, as no vector tells what the layer over the ground does there.

Vectors of tracked particles are at random places already.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import torch

from granpinn.axes import Axes
from granpinn.data.flow import BoolArray, Flow
from granpinn.data.points import TrainingSet, turned_and_rounded, vectors_used

if TYPE_CHECKING:
    from granpinn.scales import Scales

# Philox; the same points for every seed, so that the members of an ensemble share them.
_KEY = 3 << 64


def with_collocation(
    training: TrainingSet, flow: Flow, scales: Scales, share: float
) -> TrainingSet:
    """The training set of a flow with points between its vectors, `share` of them for each vector.

    As it is where share is 0, for tracked particles, and where no cell of the grid above the lowest
    row is full of grains.
    """
    if flow.particles is not None:
        return training
    asked = above_ground(flow.material & (flow.t > 0)[:, None, None], flow.gravity)
    x, y, t = points_between(flow, asked, round(share * len(training.points)))
    if x.size == 0:
        return training
    points = scales.points_to_dimensionless(x, y, t)
    between = torch.as_tensor(turned_and_rounded(points, Axes.of(flow.gravity)))
    weights = training.point_weights.clone()
    weights[:, 1] *= torch.as_tensor(asked[vectors_used(flow)])
    return replace(training, point_weights=weights, between=between.to(training.points))


def above_ground(grains: BoolArray, gravity: tuple[float, float]) -> BoolArray:
    """`grains` [T, Y, X] without its lowest row, against gravity."""
    g_x, g_y = gravity
    axis, falls = (2, g_x) if abs(g_x) > abs(g_y) else (1, g_y)
    rows = np.flatnonzero(grains.any(axis=(0, 3 - axis)))
    above = grains.copy()
    if rows.size:
        np.moveaxis(above, axis, 0)[rows[-1] if falls > 0 else rows[0]] = False
    return above


def points_between(
    flow: Flow, grains: BoolArray, count: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Random x, y, t [count], in the units of the file; none where no cell is complete.

    A cell, in space and time, is one of the grid of the vectors whose eight corners are in `grains`
    [T, Y, X], with a vector or without. All cells are as likely, and so are all places in one.
    """
    complete = grains
    for axis in range(3):
        complete = np.delete(complete, -1, axis) & np.delete(complete, 0, axis)
    cells = np.argwhere(complete)
    rng = np.random.Generator(np.random.Philox(key=_KEY))
    drawn = cells[rng.integers(len(cells), size=count)] if len(cells) else cells
    part = rng.random(drawn.shape)

    def within(edges: npt.NDArray[np.floating], axis: int) -> npt.NDArray[np.float64]:
        values, k = edges.astype(np.float64), drawn[:, axis]
        return np.asarray(values[k] + part[:, axis] * (values[k + 1] - values[k]))

    return within(flow.x, 2), within(flow.y, 1), within(flow.t, 0)
