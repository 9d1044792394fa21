"""The friction law as unknowns: an unbounded number q for each free parameter.

Every q gives a possible law. `LawParameter.variable` says how; the setting "sigmoid" makes every
free parameter logistic, so that it lies in [0, 1], as in the paper:

log:        theta_k = exp(q)
log_above:  theta_k = theta_(k-1) + exp(q), hence theta_k > theta_(k-1)
logistic:   theta_k = 1 / (1 + exp(-q))

A step moves q and theta in C++ (csrc/math/law_variables.h). It also keeps the logarithms within
the bounds of the parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from granpinn.config import Rheology
from granpinn.physics.laws import Law

_DRAW = (0.05, 0.95)  # range of a start that is drawn at random


class LawVariables:
    """q [E, F] of the F free parameters of a law for E members, and theta [E, N], its image.

    Args:
        fixed: values of the fixed parameters, by name, of every member.
        seeds: of every member, for a random start.
        like: a tensor with the dtype and the device of q and theta.
    """

    def __init__(
        self,
        law: Law,
        settings: Rheology,
        fixed: Sequence[Mapping[str, float]],
        seeds: Sequence[int],
        like: Tensor,
    ) -> None:
        self.variables = settings.variables
        self.kinds = [
            "fixed" if p.fixed else "logistic" if settings.variables == "sigmoid" else p.variable
            for p in law.parameters
        ]
        first = []
        for values, seed in zip(fixed, seeds, strict=True):
            free = iter(start_of(law, settings, seed))
            first.append(
                [values.get(p.name, p.start) if p.fixed else next(free) for p in law.parameters]
            )
        self.start = like.new_tensor(first)
        self.q = like.new_tensor([self._q_of(theta) for theta in first])
        self.theta = self.theta_of(self.q)

    def theta_of(self, q: Tensor) -> Tensor:
        """theta [E, N] at q [E, F]."""
        theta: list[Tensor] = []
        free = iter(q.unbind(1))
        for kind, start in zip(self.kinds, self.start.unbind(1), strict=True):
            if kind == "fixed":
                theta.append(start)
            elif kind == "logistic":
                theta.append(next(free).sigmoid())
            else:
                value = next(free).exp()
                theta.append(theta[-1] + value if kind == "log_above" else value)
        return torch.stack(theta, 1)

    def _q_of(self, theta: Sequence[float]) -> list[float]:
        """The inverse for one member, from all its N parameters."""
        q = []
        for k, (kind, value) in enumerate(zip(self.kinds, theta, strict=True)):
            if kind == "logistic":
                q.append(math.log(value / (1 - value)))
            elif kind != "fixed":
                q.append(math.log(value - theta[k - 1] if kind == "log_above" else value))
        return q


def start_of(law: Law, settings: Rheology, seed: int) -> list[float]:
    """Values of the free parameters at the start, in order; random ones are ascending."""
    count = len(law.free)
    if settings.mu_s is None or settings.mu_2 is None:
        generator = torch.Generator().manual_seed(seed)
        draws = torch.rand(count, dtype=torch.float64, generator=generator)
        return sorted((_DRAW[0] + (_DRAW[1] - _DRAW[0]) * draws).tolist())
    return [settings.mu_s, settings.mu_2][:count]
