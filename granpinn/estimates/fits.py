"""What the local fits of velocities share: their polynomials, and the shear rate from their slopes.

- `gradients.py`: linear, on a grid with any number of vectors in a cell; errors from the noise;
- `quadratic_fits.py`: quadratic, on a grid with gaps, also periodic; for accelerations;
- `scattered_fits.py`: quadratic, among the nearest vectors of one frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np

from granpinn.arrays import Float64


def quadratic_basis(offsets: Sequence[Float64]) -> Float64:
    """1, the offsets from the middle along every axis, and their products in pairs [..., n].

    Args:
        offsets: along one axis each, all of one shape [...].
    """
    products = [a * b for a, b in combinations_with_replacement(offsets, 2)]
    return np.stack([np.ones_like(offsets[0]), *offsets, *products], axis=-1)


def shear_rate(u_x: Float64, u_y: Float64, v_x: Float64, v_y: Float64, bias: Float64) -> Float64:
    r"""$\dot\gamma$, with $\dot\gamma^2 = (u_x - v_y)^2 + (u_y + v_x)^2$ less its bias, at least 0.

    Args:
        bias: mean contribution of the noise to the square, of the shape of the slopes.
    """
    return np.asarray(np.sqrt(np.maximum((u_x - v_y) ** 2 + (u_y + v_x) ** 2 - bias, 0.0)))
