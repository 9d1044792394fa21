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
from granpinn.kernels import step_ops
from granpinn.physics.laws import FrictionLaw, LawParameter

NO_BOUNDS = (-math.inf, math.inf)
_DRAW = (0.05, 0.95)  # range of a start that is drawn at random


class LawVariables:
    """q [E, N] of the laws of E members, and theta [E, N], its image.

    N is the number of parameters of the longest law. A shorter law is filled up with fixed zeros.

    Args:
        laws: of every member.
        fixed: values of the fixed parameters, by name, of every member.
        seeds: of every member, for a random start.
        like: a tensor with the dtype and the device of q and theta.

    Attributes:
        kinds: the kind of every q of every member, see the top.
        codes: the same as numbers (granpinn.kernels.step_ops.VARIABLES) [E, N].
        bounds: the least and the largest value of every q [E, N, 2].
    """

    def __init__(
        self,
        laws: Sequence[FrictionLaw],
        settings: Rheology,
        fixed: Sequence[Mapping[str, float]],
        seeds: Sequence[int],
        like: Tensor,
    ) -> None:
        longest = max(len(law.parameters) for law in laws)
        first, bounds = [], []
        self.kinds: list[list[str]] = []
        for law, values, seed in zip(laws, fixed, seeds, strict=True):
            blank = longest - len(law.parameters)
            kinds = [_kind_of(p, settings) for p in law.parameters]
            limits = [
                tuple(map(math.log, p.bounds)) if kind in ("log", "log_above") else NO_BOUNDS
                for kind, p in zip(kinds, law.parameters, strict=True)
            ]
            bounds.append(limits + [NO_BOUNDS] * blank)
            self.kinds.append(kinds + ["fixed"] * blank)
            free = iter(start_of(law, settings, seed))
            theta = [values.get(p.name, p.start) if p.fixed else next(free) for p in law.parameters]
            first.append(theta + [0.0] * blank)
        of_all = [[step_ops.VARIABLES[kind] for kind in kinds] for kinds in self.kinds]
        self.codes = torch.tensor(of_all, device=like.device)
        self.bounds = torch.tensor(bounds, dtype=torch.float64, device=like.device)
        self.start = like.new_tensor(first)
        self.q = like.new_tensor(list(map(_q_of, self.kinds, first)))
        self.theta = self.theta_of(self.q)

    def theta_of(self, q: Tensor) -> Tensor:
        """theta [E, N] at q [E, N]."""
        return torch.stack(list(map(_theta_of, self.kinds, self.start, q)))


def _kind_of(p: LawParameter, settings: Rheology) -> str:
    if p.fixed:
        return "fixed"
    return "logistic" if settings.variables == "sigmoid" else p.variable


def _theta_of(kinds: Sequence[str], start: Tensor, q: Tensor) -> Tensor:
    """theta [N] of one member; `start` has the fixed ones."""
    theta: list[Tensor] = []
    for kind, first, value in zip(kinds, start, q, strict=True):
        if kind == "fixed":
            theta.append(first)
        elif kind == "logistic":
            theta.append(value.sigmoid())
        else:
            theta.append(theta[-1] + value.exp() if kind == "log_above" else value.exp())
    return torch.stack(theta)


def _q_of(kinds: Sequence[str], theta: Sequence[float]) -> list[float]:
    """The inverse, from all N parameters."""
    q = []
    for k, (kind, value) in enumerate(zip(kinds, theta, strict=True)):
        if kind == "fixed":
            q.append(0.0)
        elif kind == "logistic":
            q.append(math.log(value / (1 - value)))
        else:
            q.append(math.log(value - theta[k - 1] if kind == "log_above" else value))
    return q


def start_of(law: FrictionLaw, settings: Rheology, seed: int) -> list[float]:
    """Values of the free parameters at the start, in order; random ones are ascending."""
    if not settings.random_start:
        return [law.parameter(name).start for name in law.free]
    generator = torch.Generator().manual_seed(seed)
    draws = torch.rand(len(law.free), dtype=torch.float64, generator=generator)
    return sorted((_DRAW[0] + (_DRAW[1] - _DRAW[0]) * draws).tolist())


def relative_change(law: FrictionLaw, before: Tensor, after: Tensor) -> float:
    """The largest relative change of a free parameter, or of a curve over its range of I.

    Args:
        before, after: theta [N]. The ends of a curve have a sixth of its outer coefficients, so
            these may change far more than the curve. A cohesion may be as good as zero; its change
            is relative to the yield stress at I = 0 under the pressure 1.
    """
    if law.curve:
        low, high = (math.log10(float(before[law.names.index(name)])) for name in law.quantiles)
        I = torch.logspace(low, high, 50, dtype=before.dtype, device=before.device)
        old, new = (law.friction(I, *theta) for theta in (before, after))
    else:
        free = [k for k, p in enumerate(law.parameters) if not p.fixed]
        old, new = before[free], after[free]
    size = old.clone()
    if law.cohesion:
        size[law.free.index(law.cohesion)] += law.friction(0.0, *before)
    return float(((new - old).abs() / size).max())
