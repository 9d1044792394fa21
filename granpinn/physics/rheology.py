r"""The inertial number, and the derivatives of a friction law by its parameters.

Equation (1) of the paper is $I = d\,\dot\gamma / \sqrt{|p| / \rho_g}$.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from granpinn.arrays import Float64
from granpinn.physics.laws import FrictionLaw


def inertial_number(gamma_dot: Tensor, p: Tensor, d: float, p_floor: float) -> Tensor:
    """I = d gamma_dot / sqrt(max(|p|, p_floor)), dimensionless with rho_g = 1.

    Args:
        gamma_dot: shear rate sqrt(2 D:D) of any shape, in units of U/L.
        p: pressure of the same shape, in units of rho |g| L.
        d: grain diameter, in units of L.
        p_floor: positive pressure below which I no longer grows, so that I is finite at p = 0.
    """
    return d * gamma_dot / torch.sqrt(torch.clamp(torch.abs(p), min=p_floor))


def by_parameters(law: FrictionLaw, I: Float64, theta: Sequence[float] | Float64) -> Float64:
    """d mu / d theta of a law at inertial numbers I [n], for all N parameters: [n, N]."""
    rows = torch.tensor(theta, dtype=torch.float64).repeat(len(I), 1).requires_grad_()
    mu = law.friction(torch.as_tensor(I), *rows.unbind(1))
    (found,) = torch.autograd.grad(mu.sum(), rows)  # value k depends on row k alone
    return np.asarray(found.numpy())
