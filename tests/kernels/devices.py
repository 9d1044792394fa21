"""The ops on another device, for tests and an oracle that hold their tensors on the CPU."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import torch
from torch import Tensor
from torch.utils._pytree import tree_map


def moved(x: Any, device: str | torch.device) -> Any:
    """A tensor on a device, with its strides (`Tensor.to` closes gaps); anything else as it is."""
    if not isinstance(x, Tensor):
        return x
    there = x.to(device)
    if there.stride() == x.stride() or 0 in x.stride() or not x.numel():
        return there
    span = 1 + sum((n - 1) * step for n, step in zip(x.shape, x.stride(), strict=True))
    return there.new_zeros(span).as_strided(x.shape, x.stride()).copy_(there)


class OnDevice(ModuleType):
    """A module of functions of tensors that run on `device`; gradients flow through the copies."""

    def __init__(self, functions: ModuleType, device: str) -> None:
        super().__init__(f"{functions.__name__} on {device}")
        self.functions, self.device = functions, device

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function = getattr(self.functions, name)
        constants = {"device": self.device} if name == "sample_indices" else {}

        def call(*arguments: Any, **named: Any) -> Any:
            there, by_name = tree_map(lambda x: moved(x, self.device), (arguments, named))
            out = function(*there, **constants, **by_name)
            return out.cpu() if isinstance(out, Tensor) else tuple(x.cpu() for x in out)

        return call


def device_of(ops: ModuleType) -> str:
    """Where the ops of a fixture run."""
    return ops.device if isinstance(ops, OnDevice) else "cpu"
