"""Valid inputs of the operators of an optimization step."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from granpinn.kernels import step_ops
from granpinn.kernels.network import n_params
from granpinn.training.optimise import ParameterGroup
from granpinn.training.schedule import HEALTHY

SIZES = [(50, 8), (20, 5)]  # points and surface points of two data sets
MEMBERS = [(0, 7), (1, 2**40 + 5), (0, 9)]  # data set and seed
STEP = 2**33 + 3
PHYSICS = [0.02, 0.0, -1.0, 1e-3, 100.0, 1.0, 1.0, 1e-3, 2.0, 0.3, 0.1, 0.5]


def batch_arguments(dtype: torch.dtype, device: torch.device | str = "cpu") -> list[Any]:
    """All but the sizes; the first row of the control table belongs to STEP - 1."""
    N, M = (sum(sizes) for sizes in zip(*SIZES, strict=True))
    places = [[0, 50, 0, 8], [50, 20, 8, 5]]
    table = torch.ones(4, 1 + len(MEMBERS), dtype=torch.float64)
    table[1, 1:] = torch.tensor([0.5, 0.25, 2.0])
    tensors = [
        torch.tensor([STEP, STEP - 1, 0]),
        table,
        torch.tensor([seed for _, seed in MEMBERS]),
        torch.tensor([places[which] for which, _ in MEMBERS]),
        *(torch.randn(N, k, dtype=dtype) for k in (3, 2, 2)),
        torch.randn(M, 3, dtype=dtype),
        torch.randn(M, dtype=dtype),
        torch.randn(len(MEMBERS), 5, dtype=dtype),
    ]
    return [tensor.to(device) for tensor in tensors]


def loss_arguments(E: int, dtype: torch.dtype, device: str | torch.device = "cpu") -> list[Any]:
    """The rest: params, theta, widths, input map, physics, form, law, precision."""
    widths = [3, 20, 30, 5]
    tensors = [
        torch.randn(E, n_params(widths), dtype=dtype) / 4,
        torch.tensor([[0.4, 0.7, 0.3]], dtype=dtype).repeat(E, 1),
        *(torch.rand(E, 3, dtype=dtype) for _ in range(2)),
        torch.tensor([PHYSICS], dtype=dtype).repeat(E, 1),
    ]
    params, theta, *rest = (tensor.to(device) for tensor in tensors)
    return [params, theta, widths, *rest, "mixed", "mu_of_i", "fast"]


def state(E: int, device: str = "cpu") -> list[Tensor]:
    """counter, table, lr_scale, fault, counts."""
    return [
        torch.zeros(3, dtype=torch.int64, device=device),
        torch.ones(2, 1 + E, dtype=torch.float64, device=device),
        torch.ones(E, dtype=torch.float64, device=device),
        torch.full((E,), HEALTHY, device=device),
        torch.zeros(E, 2, dtype=torch.int64, device=device),
    ]


def update_arguments(E: int, P: int, dtype: torch.dtype) -> list[Any]:
    """Loss and network from 5 on, those of the friction law from 14 on."""
    adam = [1e-3, 0.9, 0.99, 1e-8]
    network = [torch.rand(E, *(P,) * (i > 0), dtype=dtype) for i in range(6)]
    law = [torch.rand(E, 3, dtype=dtype) for _ in range(5)]
    codes = [step_ops.VARIABLES[kind] for kind in ("log", "log_above", "fixed")]
    variables = torch.tensor(codes).repeat(E, 1)
    limits = torch.tensor([[-4.0, 1.0], [-4.0, 1.0], [0.0, 0.0]], dtype=torch.float64)
    bounds = limits.repeat(E, 1, 1)
    return [*state(E), *network, [2, 4, 7, 3], adam, 0.95, *law, adam, variables, bounds, True]


def descend_arguments(E: int, P: int, dtype: torch.dtype) -> list[Any]:
    direction, params = (torch.rand(E, P + 14, dtype=dtype) for _ in range(2))
    group = ParameterGroup(3, 2, 2, 3)
    places = (group.offset, group.apart, 0.1, "fast")
    return [*state(E), group.of(direction), params, *places]


def source(dtype: torch.dtype, device: str | torch.device = "cpu") -> Tensor:
    return torch.randn(sum(N for N, _ in SIZES), 2, dtype=dtype).to(device)


def draw(sizes: tuple[int, int], dtype: torch.dtype, sourced: bool = False) -> tuple[Any, ...]:
    given = (source(dtype),) if sourced else ()
    return (*batch_arguments(dtype), *sizes, *given)


def batch_loss(
    sizes: tuple[int, int], dtype: torch.dtype, form: str, sourced: bool
) -> tuple[Any, ...]:
    *rest, _, law, precision = loss_arguments(len(MEMBERS), dtype)
    given = (source(dtype),) if sourced else ()
    return (*draw(sizes, dtype), *rest, form, law, precision, *given)


def update(E: int, P: int, dtype: torch.dtype, law_moves: bool) -> tuple[Any, ...]:
    return (*update_arguments(E, P, dtype)[:-1], law_moves)


def descend(E: int, count: int, dtype: torch.dtype, precision: str) -> tuple[Any, ...]:
    arguments = descend_arguments(E, 10, dtype)
    arguments[5] = arguments[5][:, :count]
    return (*arguments[:-1], precision)
