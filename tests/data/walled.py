"""Walls for tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Walls

NAN = np.nan


def line(*points: tuple[float, float], **others: Any) -> Walls:
    """Walls through points; (NaN, NaN) parts two pieces."""
    x, y = np.array(points, float).T
    return Walls(x=x.copy(), y=y.copy(), **others)


FLOOR = line((0, 0), (2, 0))
TWO = line((0, 0), (2, 0), (NAN, NAN), (0, 0), (0, 1))


def full(value: float, m: int = 2) -> Float64:
    return np.full(m, value)


def single(*values: float) -> Any:
    return np.array(values, np.float32)


EVERYTHING = replace(
    TWO,
    u=np.array([1.0, 1.0, NAN, 0, 1 / 3]),
    v=np.zeros(5),
    slip=single(0, 0, NAN, 1, 1),
    p=single(1, NAN, NAN, 2, 3),
)
