"""The friction law as unknowns: an unbounded number q for each parameter.

Every q gives a possible law. `LawParameter.variable` is the kind of a parameter. The setting
"sigmoid" makes every free parameter logistic, so that it lies in [0, 1], as in the paper:

log:        theta_k = exp(q)
log_above:  theta_k = theta_(k-1) + exp(q), hence theta_k > theta_(k-1)
logistic:   theta_k = 1 / (1 + exp(-q))
fixed:      theta_k is constant; q is 0 and has no effect

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
    """q [E, N] of a law with N parameters for E members, and theta [E, N], its image.

    Args:
        fixed: values of the fixed parameters, by name, of every member.
        seeds: of every member, for a random start.
        like: a tensor with the dtype and the device of q and theta.

    Attributes:
        kinds: the kind of every q, see the top.
        bounds: the least and the largest value of every q, one pair after another.
    """

    def __init__(
        self,
        law: Law,
        settings: Rheology,
        fixed: Sequence[Mapping[str, float]],
        seeds: Sequence[int],
        like: Tensor,
    ) -> None:
        self.kinds = [
            "fixed" if p.fixed else "logistic" if settings.variables == "sigmoid" else p.variable
            for p in law.parameters
        ]
        self.bounds = [
            math.log(bound) if kind in ("log", "log_above") else sign * math.inf
            for kind, p in zip(self.kinds, law.parameters, strict=True)
            for sign, bound in zip((-1, 1), p.bounds, strict=True)
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
        """theta [E, N] at q [E, N]."""
        theta: list[Tensor] = []
        for kind, start, value in zip(self.kinds, self.start.unbind(1), q.unbind(1), strict=True):
            if kind == "fixed":
                theta.append(start)
            elif kind == "logistic":
                theta.append(value.sigmoid())
            else:
                theta.append(theta[-1] + value.exp() if kind == "log_above" else value.exp())
        return torch.stack(theta, 1)

    def _q_of(self, theta: Sequence[float]) -> list[float]:
        """The inverse for one member, from all its N parameters."""
        q = []
        for k, (kind, value) in enumerate(zip(self.kinds, theta, strict=True)):
            if kind == "fixed":
                q.append(0.0)
            elif kind == "logistic":
                q.append(math.log(value / (1 - value)))
            else:
                q.append(math.log(value - theta[k - 1] if kind == "log_above" else value))
        return q


def start_of(law: Law, settings: Rheology, seed: int) -> list[float]:
    """Values of the free parameters at the start, in order; random ones are ascending."""
    if settings.start is not None:
        return list(settings.start)
    if not settings.random_start:
        return [law.parameter(name).start for name in law.free]
    generator = torch.Generator().manual_seed(seed)
    draws = torch.rand(len(law.free), dtype=torch.float64, generator=generator)
    return sorted((_DRAW[0] + (_DRAW[1] - _DRAW[0]) * draws).tolist())
