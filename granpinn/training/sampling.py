"""The points of a step, a pure function of (seed, step) without a state to save.

The numbers come from Philox4x32-10 in C++ (csrc/math/philox.h), the same bits on every device.
Points are drawn with replacement; the streams of interior and surface points are independent.
"""

from __future__ import annotations

import torch
from torch import Tensor

from granpinn.kernels import ops

INTERIOR, SURFACE, MISFIT, LAST_LAYER = 0, 1, 2, 3  # streams; the last layer uses 3, 4 and 5


def draw(seed: int, step: int, stream: int, count: int, points: Tensor) -> Tensor:
    """Indices int64 [count] into points [N, ...], on their device; none if there are no points."""
    if len(points) == 0:
        return points.new_empty(0, dtype=torch.int64)
    return ops.sample_indices(seed, step, stream, count, len(points), points.device)
