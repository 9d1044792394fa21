"""A residual of the last-layer step with its slopes."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor


class PointRow(NamedTuple):
    """One residual of the equations or of the surface at n points, with its slopes.

    Attributes:
        points: which: first those of the equations, then those of the surface.
        residual: weighted [n].
        h: jets of the features [6 or 1, n, F].
        by_z: derivatives by the fields z and theirs [6 or 1, n, 5].
        by_theta: derivatives by the free parameters of the law [n, L].
        used: the fields on which it depends.
    """

    points: slice
    residual: Tensor
    h: Tensor
    by_z: Tensor
    by_theta: Tensor
    used: list[int]
