"""The unknowns mu_s and mu_2 as two unbounded numbers q: every q is a possible friction law.

log:      mu_s = exp(q_0), mu_2 = exp(q_0) + exp(q_1), hence 0 < mu_s < mu_2;
sigmoid:  mu_s = 1 / (1 + exp(-q_0)), mu_2 = 1 / (1 + exp(-q_1)), both in [0, 1], as in the paper.

I0 is given, not identified. A step moves q and theta in C++ (csrc/math/law_variables.h), where the
logarithms are also kept in the range in which a friction law can be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from granpinn.config import Rheology
from granpinn.physics.laws import DEFAULT

_DRAW = (0.05, 0.95)  # range of a start that is drawn at random


class Scalars:
    """q [E, 2] (`values`) of E members and theta [E, 3] = (mu_s, mu_2, I0), its image."""

    def __init__(
        self, start: Rheology, I0: Sequence[float], seeds: Sequence[int], like: Tensor
    ) -> None:
        self.variables = start.variables
        self.values = like.new_tensor([_first_q(start, seed) for seed in seeds])
        self.I0 = like.new_tensor(I0)[:, None]
        self.theta = self.law(self.values)

    def law(self, q: Tensor) -> Tensor:
        """theta [E, 3] at q [E, 2]."""
        mu = q.exp().cumsum(1) if self.variables == "log" else q.sigmoid()
        return torch.cat([mu, self.I0], 1)


def _first_q(start: Rheology, seed: int) -> list[float]:
    if start.start is None and start.random_start:
        generator = torch.Generator().manual_seed(seed)
        draws = torch.rand(2, dtype=torch.float64, generator=generator)
        mu_s, mu_2 = sorted((_DRAW[0] + (_DRAW[1] - _DRAW[0]) * draws).tolist())
    else:
        mu_s, mu_2 = start.start or [p.start for p in DEFAULT.parameters if not p.fixed]
    if start.variables == "log":
        return [math.log(mu_s), math.log(mu_2 - mu_s)]
    return [math.log(mu / (1 - mu)) for mu in (mu_s, mu_2)]
