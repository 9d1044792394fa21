"""Halves of the data in which the friction law is compared: early and late, slow and fast, ...

Each half holds half of what the points tell of the law. The halves by shear rate, height and side
are taken at every time anew. So a flow that slows down is not split by time twice.

Where the law changes, the stress changes as well, and one last layer cannot follow: it would take a
half of the change into the residuals. So each half has its own last layer for pressure and stress.
In time it begins at once, as no derivative of the stress by time is in the equations. In space it
takes over smoothly, so that the forces stay finite.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

BINS = 16  # times at which the halves in space are taken anew
SMOOTH = 0.5  # of the distance from the middle to the quartiles, over which a half takes over


@dataclass(frozen=True)
class Step:
    """The place where the second half begins, and the share of its stress around it.

    Attributes:
        axis: x, y or t (0, 1, 2).
        edges: of the bins in time [B - 1].
        middle: of every bin [B].
        width: over which the second half takes over [B].
    """

    axis: int
    edges: Tensor
    middle: Tensor
    width: Tensor

    def jet(self, points: Tensor) -> Tensor:
        """The share of the second half at points [n, 3], and its derivatives by x and y: [3, n]."""
        k = torch.bucketize(points[:, 2].double().contiguous(), self.edges)
        distance = points[:, self.axis].double() - self.middle[k]
        none = torch.zeros_like(distance)
        if self.axis == 2:
            return torch.stack([(distance > 0).double(), none, none])
        share = torch.sigmoid(distance / self.width[k])
        slope = share * (1 - share) / self.width[k]
        return torch.stack([share, slope, none] if self.axis == 0 else [share, none, slope])


@dataclass(frozen=True)
class Halves:
    """A split of the data.

    Attributes:
        name: one of granpinn/results/parts.py.
        second: which points of the equations belong to the second half [N].
        step: where it begins; None: not a surface in space and time, so that both halves share
            their stress.
    """

    name: str
    second: Tensor
    step: Step | None


def splits_of(
    points: Tensor, gamma_dot: Tensor, told: Tensor, changes: tuple[bool, bool, bool]
) -> list[Halves]:
    """The splits of a flow.

    Args:
        points: of the equations [N, 3].
        gamma_dot: shear rate there [N].
        told: how much each point tells of the law [N], the squared slope of its residuals.
        changes: whether the flow changes with x, y and t.
    """
    points = points.double()
    t = points[:, 2].contiguous()
    bins = BINS if changes[2] else 1
    edges = quantiles(t, told, [k / bins for k in range(1, bins)])
    bin_of = torch.bucketize(t, edges)

    def local(values: Tensor, q: float) -> Tensor:
        every = [quantiles(values[bin_of == k], told[bin_of == k], [q]) for k in range(bins)]
        return torch.cat(every)

    found = []
    if changes[2]:
        middle = quantiles(t, told, [0.5])
        step = Step(2, edges[:0], middle, torch.zeros_like(middle))
        found.append(Halves("time", t > middle, step))
    found.append(Halves("rate", gamma_dot > local(gamma_dot, 0.5)[bin_of], None))
    for name, axis in (("height", 1), ("side", 0)):
        if changes[axis]:
            x = points[:, axis]
            middle, spread = local(x, 0.5), local(x, 0.75) - local(x, 0.25)
            width = (SMOOTH / 2 * spread).clamp_min(1e-3 * float(x.max() - x.min()))
            found.append(Halves(name, x > middle[bin_of], Step(axis, edges, middle, width)))
    return [halves for halves in found if halves.second.any() and not halves.second.all()]


def quantiles(values: Tensor, weights: Tensor, q: list[float]) -> Tensor:
    """Weighted quantiles [len(q)] of values [n]; NaN without values."""
    if not len(values):
        return values.new_full((len(q),), torch.nan)
    order = torch.argsort(values)
    share = torch.cumsum(weights[order], 0)
    wanted = values.new_tensor(q) * share[-1]
    return values[order][torch.searchsorted(share, wanted).clamp_max(len(values) - 1)]
