"""The unknowns mu_s and mu_2 as two unbounded numbers q: every q is a possible friction law.

log:      mu_s = exp(q_0), mu_2 = exp(q_0) + exp(q_1), hence 0 < mu_s < mu_2;
sigmoid:  mu_s = 1 / (1 + exp(-q_0)), mu_2 = 1 / (1 + exp(-q_1)), both in [0, 1], as in the paper.

I0 is given, not identified.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from granpinn.config import Rheology

_DRAW = (0.05, 0.95)  # range of a start that is drawn at random
_LOG_BOUNDS = (math.log(0.01), math.log(3))  # of mu_s and of mu_2 - mu_s


class Scalars:
    """q [2] (`values`) and its map to theta = (mu_s, mu_2, I0) [3]."""

    def __init__(self, start: Rheology, I0: float, seed: int, like: Tensor) -> None:
        self.variables = start.variables
        mu_s, mu_2 = start.mu_s, start.mu_2
        if mu_s is None or mu_2 is None:
            generator = torch.Generator().manual_seed(seed)
            draws = torch.rand(2, dtype=torch.float64, generator=generator)
            mu_s, mu_2 = sorted((_DRAW[0] + (_DRAW[1] - _DRAW[0]) * draws).tolist())
        if self.variables == "log":
            q = [math.log(mu_s), math.log(mu_2 - mu_s)]
        else:
            q = [math.log(mu / (1 - mu)) for mu in (mu_s, mu_2)]
        self.values = like.new_tensor(q)
        self.I0 = like.new_tensor([I0])

    def theta(self, values: Tensor | None = None) -> Tensor:
        """theta [3] at q [2], by default the present one."""
        q = self.values if values is None else values
        if self.variables == "log":
            return torch.cat([q.exp().cumsum(0), self.I0])
        return torch.cat([q.sigmoid(), self.I0])

    def confine(self) -> None:
        """Keep the logarithms where a friction law can be: a wild early step is not final."""
        if self.variables == "log":
            self.values.clamp_(*_LOG_BOUNDS)

    def pull_back(self, grad_theta: Tensor) -> Tensor:
        """d loss / d q [2] from d loss / d theta [3]."""
        g = grad_theta[:2]
        if self.variables == "log":
            return self.values.exp() * g.flip(0).cumsum(0).flip(0)
        mu = self.values.sigmoid()
        return mu * (1 - mu) * g
