"""Where the equations are asked for beside the data: points between the vectors of a grid.

Equations that are asked for at the vectors alone are overfitted there, so the network has to follow
them at random places and times between the vectors too; but not between the lowest two rows. The
layer over the ground is often thinner than that, and no vector tells what it does there: asked for
the equations there, the network bends the law to the layer that it made up
(bench/studies/collocation).

Vectors of tracked particles are at random places already.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import torch

from granpinn.data.flow import BoolArray, Flow
from granpinn.data.points import TrainingSet, turned_and_rounded
from granpinn.physics.axes import Axes, vertical_coordinate

if TYPE_CHECKING:
    from granpinn.physics.scales import Scales

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
    above = above_ground(flow.material & (flow.t > 0)[:, None, None], flow.gravity)
    x, y, t = points_between(flow, above, round(share * len(training.points)))
    if x.size == 0:
        return training
    points = scales.points_to_dimensionless(x, y, t)
    between = torch.as_tensor(turned_and_rounded(points, Axes.of(flow.gravity)))
    return replace(training, between=between.to(training.points))


def above_ground(grains: BoolArray, gravity: tuple[float, float]) -> BoolArray:
    """`grains` [T, Y, X] without its lowest row, against gravity."""
    coordinate, downwards = vertical_coordinate(gravity)
    axis = 2 - coordinate
    rows = np.flatnonzero(grains.any(axis=(0, 3 - axis)))
    above = grains.copy()
    if rows.size:
        np.moveaxis(above, axis, 0)[rows[-1] if downwards else rows[0]] = False
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
