"""Equal boxes in space and time: neighbors share errors, so the residuals of a box count as one."""

from __future__ import annotations

from torch import Tensor


class Boxes:
    """Boxes between bounds of (x, y, t), each [3], `count` along every axis; `total` of them.

    An axis without an extent has one layer of boxes.
    """

    def __init__(self, lower: Tensor, upper: Tensor, count: int) -> None:
        self.lower, self.count, self.total = lower.double(), count, count**3
        self.size = (upper.double() - self.lower).clamp_min(1e-30) / count

    def number(self, points: Tensor) -> Tensor:
        """The number [n] of the box of each of the points [n, 3]; beyond the bounds the nearest."""
        lower, size = self.lower.to(points.device), self.size.to(points.device)
        k = ((points.double() - lower) / size).long().clamp(0, self.count - 1)
        return (k[:, 0] * self.count + k[:, 1]) * self.count + k[:, 2]
