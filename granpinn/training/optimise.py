"""One update of E networks and laws: Adam, or Muon for the hidden matrices and Adam elsewhere.

The state is a few tensors with a leading axis of members, which a checkpoint holds. The arithmetic
is in csrc/step.h. This module lists the parameters that are matrices.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from granpinn.config import Optimizer
from granpinn.kernels.network import layer_offsets
from granpinn.training.law_variables import LawVariables
from granpinn.training.schedule import ControlTable

BETA_1 = 0.9

_ops = torch.ops.granpinn


@dataclass(frozen=True)
class ParameterGroup:
    """`count` successive hidden matrices [m, n] in a parameter vector, from `offset` on.

    A bias lies between two of them: matrix l begins at offset + l (m n + m).
    """

    offset: int
    count: int
    m: int
    n: int

    @property
    def apart(self) -> int:
        return self.m * self.n + self.m

    def of(self, flat: Tensor) -> Tensor:
        """The matrices [E, count, m, n] in flat [E, P], as a view."""
        shape = (flat.shape[0], self.count, self.m, self.n)
        strides = (flat.stride(0), self.apart, self.n, 1)
        return flat.as_strided(shape, strides, flat.storage_offset() + self.offset)


class BatchOptimizer:
    """Updates params [E, P] and the law variables q [E, N] in place.

    Args:
        precision: of Muon's products on a GPU, "fp32" or "fast" (granpinn/kernels/step_ops.py).
    """

    def __init__(
        self,
        params: Tensor,
        law_variables: LawVariables,
        widths: Sequence[int],
        settings: Optimizer,
        control: ControlTable,
        precision: str = "fp32",
    ) -> None:
        self.params, self.law_variables = params, law_variables
        self.control, self.settings, self.precision = control, settings, precision
        self.groups = hidden_groups(widths) if settings.method == "muon" else []
        self.matrices = [
            number
            for g in self.groups
            for i in range(g.count)
            for number in (g.offset + i * g.apart, g.m * g.n)
        ]
        q = law_variables.q
        self.counts = torch.zeros(len(params), 2, dtype=torch.int64, device=params.device)
        self.first, self.second = torch.zeros_like(params), torch.zeros_like(params)
        self.first_q, self.second_q = torch.zeros_like(q), torch.zeros_like(q)
        self.direction = torch.zeros_like(params)

    def step(
        self, loss: Tensor, grad_params: Tensor, grad_theta: Tensor, law_moves: bool = True
    ) -> None:
        """One update of all members without a fault, with the learning rates of `control`.

        Args:
            loss: [E].
            grad_params: d loss / d params [E, P].
            grad_theta: d loss / d theta [E, N].
            law_moves: False while the friction law is not trained.
        """
        s, c, law = self.settings, self.control, self.law_variables
        state = (c.counter, c.table, c.lr_scale, c.fault, self.counts)
        rest = [BETA_1, s.beta_2, s.epsilon]
        _ops.update(
            *state,
            loss,
            grad_params,
            self.params,
            self.first,
            self.second,
            self.direction,
            self.matrices,
            [s.learning_rate, *rest],
            s.momentum,
            grad_theta,
            law.q,
            self.first_q,
            self.second_q,
            law.theta,
            [s.scalars_learning_rate, *rest],
            law.codes,
            law.bounds,
            law_moves,
        )
        for g in self.groups:
            rate = s.muon_learning_rate * math.sqrt(max(1.0, g.m / g.n))  # 1 for square matrices
            G = g.of(self.direction)
            _ops.descend(*state, G, self.params, g.offset, g.apart, rate, self.precision)

    def reset(self) -> None:
        """Set all momenta to zero, because the loss changes."""
        for tensor in self.tensors().values():
            tensor.zero_()

    def tensors(self) -> dict[str, Tensor]:
        """The tensors of an update besides the parameters, by name, live; [E, ...] each.

        Copying into them restores the state.
        """
        return {
            "optimizer.counts": self.counts,
            "optimizer.first": self.first,
            "optimizer.second": self.second,
            "optimizer.q.first": self.first_q,
            "optimizer.q.second": self.second_q,
        }


def hidden_groups(widths: Sequence[int]) -> list[ParameterGroup]:
    """The matrices between hidden layers; successive square ones of one shape form a group."""
    groups: list[ParameterGroup] = []
    offsets = layer_offsets(widths)
    for layer in range(1, len(widths) - 2):
        n, m = widths[layer], widths[layer + 1]
        last = groups[-1] if groups else None
        if last and (last.m, last.n) == (m, n):
            groups[-1] = ParameterGroup(last.offset, last.count + 1, m, n)
        else:
            groups.append(ParameterGroup(offsets[layer], 1, m, n))
    return groups
