r"""The inertial number, equation (1) of the paper: $I = d\,\dot\gamma / \sqrt{|p| / \rho_g}$."""

from __future__ import annotations

import torch
from torch import Tensor


def inertial_number(gamma_dot: Tensor, p: Tensor, d: float, p_floor: float) -> Tensor:
    """I = d gamma_dot / sqrt(max(|p|, p_floor)), dimensionless with rho_g = 1.

    Args:
        gamma_dot: shear rate sqrt(2 D:D) of any shape, in units of U/L.
        p: pressure of the same shape, in units of rho |g| L.
        d: grain diameter, in units of L.
        p_floor: positive pressure below which I no longer grows, so that I is finite at p = 0.
    """
    return d * gamma_dot / torch.sqrt(torch.clamp(torch.abs(p), min=p_floor))
