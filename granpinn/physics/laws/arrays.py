"""Elementary functions of numbers, NumPy arrays and torch tensors alike, for the curves of laws."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from granpinn.arrays import plain_array

LEAST_I = 1e-30
"""Added to an inertial number of which the logarithm is taken (csrc/math/scalar.h)."""


def together(*values: Any) -> tuple[Any, ...]:
    """The library, numpy or torch, and the values as its arrays.

    Torch where a value is a tensor; then all have its type and device.
    """
    torch = sys.modules.get("torch")  # not loaded: no value is a tensor
    tensor = torch and next((v for v in values if isinstance(v, torch.Tensor)), None)
    if torch is None or tensor is None:
        return (np, *(plain_array(v, "a value").astype(np.float64)[()] for v in values))
    dtype, device = tensor.dtype, tensor.device
    return (torch, *(torch.as_tensor(v, dtype=dtype, device=device) for v in values))
