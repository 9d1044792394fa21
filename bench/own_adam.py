"""The update of the benchmark's granpinn rows: the operators of granpinn's own optimizer.

`granpinn.training.optimise` makes a step of Adam of the same calls; the rivals use torch's.
"""

from __future__ import annotations

import torch
from torch import Tensor

from granpinn.config import Config, Rheology
from granpinn.physics.laws import DEFAULT
from granpinn.training.law_variables import LawVariables
from granpinn.training.schedule import ControlTable

ADAM = [5e-4, 0.9, 0.999, 1e-8]  # as torch has them: learning rate, two decay rates, epsilon

_ops = torch.ops.granpinn


class OwnAdam:
    """Adam on params [P] and theta [3], or [E, P] and [E, 3], in place.

    One launch tests for numbers that are not finite, updates and counts, as in a step of training.
    The friction law moves in the variables of mu(I); the rivals move theta itself.
    """

    def __init__(self, params: Tensor, theta: Tensor) -> None:
        self.params, self.theta = params.view(-1, params.shape[-1]), theta.view(-1, 3)
        E = len(self.params)
        control = ControlTable([lambda _: 1.0] * E, Config(), params.device)
        control.table.fill_(1)
        counts = torch.zeros(E, 2, dtype=torch.int64, device=params.device)
        self.state = (control.counter, control.table, control.lr_scale, control.fault, counts)
        self.moments = [torch.zeros_like(self.params) for _ in range(3)]
        moments = [torch.zeros_like(self.theta) for _ in range(2)]
        law = LawVariables([DEFAULT] * E, Rheology(), [{}] * E, [0] * E, self.params)
        self.law = (law.q, *moments, self.theta)
        self.variables = (law.codes, law.bounds)

    def step(self, loss: Tensor, grad_params: Tensor, grad_theta: Tensor) -> None:
        """One update; the shapes are those of residual_loss."""
        grad_params, grad_theta = grad_params.view_as(self.params), grad_theta.view_as(self.theta)
        network = (loss.view(-1), grad_params, self.params, *self.moments, [], ADAM, 0.0)
        _ops.update(*self.state, *network, grad_theta, *self.law, ADAM, *self.variables, True)
