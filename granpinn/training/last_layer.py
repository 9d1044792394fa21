r"""The end of a training: Gauss-Newton steps in the last layer and the friction law.

The other layers are fixed, and the network is z = C h (`last_layer_sums.py`). A step minimizes the
loss of the training,

$$ \sum_k \frac{1}{2 n_k \sigma_k^2} \sum_i w_i^2 (r_{ik} + J_{ik} \delta)^2, $$

in all coefficients C [5, F] and the L free parameters of the law together, on many points at once.
Members of a group have one law: their losses add, each over its value at the start of the step.
Each member has its own C.
The descent before it leaves the scatter of its small batches; the steps
remove it. They are repeated until the law has settled. A curve takes one step: a further one
follows the noise of the training.

The equations of the training hold, with two changes in the friction law (`equations.py`): it has a
mean strain rate where it is ill-posed, and a small weight where errors of the pressure are large.

Do the data contradict the mean? Where mu(I) is ill-posed, simulated grids and grains obey it in the
mean over a band. Other flows obey it at every point: those of exact solutions, or of materials
whose bands are thick. If such data are resolved well enough to show it, the loss of the trained
network is several times as large with the mean as without. Otherwise the two losses are nearly
equal, and the mean stays. bench/studies/floor has the measurements.

Members f that have one law $\theta$ have each its own last layer $C_f$. Each eliminates it,

$$ S_f = A_{\theta\theta} - A_{\theta C} A_{CC}^{-1} A_{C\theta}, \quad
   g_f = b_\theta - A_{\theta C} A_{CC}^{-1} b_C , $$

and the sums give the step of the law, $\delta = -(\sum_f S_f)^{-1} \sum_f g_f$, and with it that of
every $C_f$.

bench/studies/last_layer has the measurements. Everything is dimensionless and float64.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.training.features import Features, coefficients, with_coefficients
from granpinn.training.last_layer_sums import RIDGE, Sums, Unknowns, choose
from granpinn.training.law_variables import relative_change
from granpinn.training.objective import Member

HALVINGS = 4  # of a step that does not lower the loss, or is too long
LONGEST = 0.1  # step of a free parameter or curve, relative: a longer one is not a correction
ITERATIONS = 8  # at most
SETTLED = 0.01  # relative change of a free parameter below which the law has settled


def iterate(
    group: Sequence[Sums], at: Sequence[Unknowns], until: float = math.inf
) -> Sequence[Unknowns]:
    """The unknowns after Gauss-Newton steps from `at`, until the law has settled.

    Every step has the weights of the law at its start. A curve takes one step. A further step is
    made only if it ends before time.monotonic() is `until`.
    """
    begin, law = time.monotonic(), group[0].law
    for k in range(1 if law.curve else ITERATIONS):
        now = time.monotonic()
        if k > 0 and now + (now - begin) / k > until:
            break
        for sums in group:
            sums.weigh_anew()
        before, at = at, improve(group, at)
        if relative_change(law, before[0].theta, at[0].theta) <= SETTLED:
            break
    return at


def improve(group: Sequence[Sums], at: Sequence[Unknowns]) -> Sequence[Unknowns]:
    """The unknowns after a Gauss-Newton step from `at`.

    While a step does not lower the loss or is too long, it is halved, at most `HALVINGS` times. If
    all fail, the result is `at`.

    Args:
        group: the sums of all members that have one law.
        at: the unknowns of each, with one theta.
    """
    free, law, theta = group[0].free, group[0].law, at[0].theta
    losses = [sums.loss(own) for sums, own in zip(group, at, strict=True)]
    weights = [losses[0] / loss for loss in losses]
    before, equations = _loss(group, at, weights), []
    with torch.enable_grad():
        for sums, own, weight in zip(group, at, weights, strict=True):
            A, b = sums.normal_equations(own)
            if len(sums.differences):
                before += sums.expect_smooth(A, b, own)
            equations.append((weight * A, weight * b))
        steps = solve_group(equations, len(free))
    if steps is None:
        return at
    for part in (0.5**halving for halving in range(HALVINGS + 1)):
        moved = theta.clone()
        moved[free] += part * steps[0][-len(free) :]
        found = [
            Unknowns(own.C + (part * x[: own.C.numel()]).view_as(own.C), moved)
            for own, x in zip(at, steps, strict=True)
        ]
        allowed = relative_change(law, theta, moved) <= LONGEST and law.admits(moved.tolist())
        if allowed and _loss(group, found, weights) < before:  # not for a NaN
            return found
    return at


def _loss(group: Sequence[Sums], at: Sequence[Unknowns], weights: Sequence[float]) -> float:
    return sum(w * sums.loss(own) for sums, own, w in zip(group, at, weights, strict=True))


def last_layer(
    group: Sequence[tuple[Member, Tensor, Tensor]], step: int, until: float = math.inf
) -> list[tuple[Tensor, Tensor]]:
    """params [P] and theta [N] of trained networks of the mixed form after the steps, if any.

    Args:
        group: all members that have one law, each with its params [P] and theta [N]. A member has
            the term weights of the end of the training, and data on the device of its params; its
            seed and `step` choose the points.
        until: time.monotonic() after which no further step is made.
    """
    every, at = [], []
    for member, params, theta in group:
        spec = member.problem.spec
        features = Features(spec, params, member.problem.window)
        points = choose(member.data, features, member.seed, step)
        every.append(Sums(features, member.problem, member.law, points))
        at.append(Unknowns(coefficients(spec, params), theta.double()))
    return [
        (with_coefficients(member.problem.spec, params, found.C), found.theta.to(theta))
        for (member, params, theta), found in zip(group, iterate(every, at, until), strict=True)
    ]


CONTRADICTED = 2.0  # factor of the loss
FEWER = 8  # times fewer points than in the last-layer step


def mean_length(member: Member, params: Tensor, theta: Tensor, step: int) -> float:
    """Length of the mean strain rate of a trained network, 0 if its data contradict the mean.

    The arguments are those of `last_layer`.
    """
    spec, problem = member.problem.spec, member.problem
    features = Features(spec, params, problem.window)
    data = choose(member.data, features, member.seed, step, FEWER)
    at = Unknowns(coefficients(spec, params), theta.double())
    of_points = dataclasses.replace(problem, mean_length=0.0)
    mean, local = (Sums(features, p, member.law, data).loss(at) for p in (problem, of_points))
    return 0.0 if mean > CONTRADICTED * local else problem.mean_length


def solve(A: Tensor, b: Tensor, L: int, ridge: float = RIDGE) -> Tensor | None:
    """The step [K] of the normal equations; None where they are not positive definite.

    Args:
        L: number of parameters of the law, the last ones of the K unknowns.
        ridge: added to the unit diagonal of the scaled equations for C. The hidden units are nearly
            dependent; the ridge keeps the step small in directions that no data determine.
    """
    found = factor(A, L, ridge)
    if found is None:
        return None
    return -torch.cholesky_solve((b / found.scale)[:, None], found.factor)[:, 0] / found.scale


def solve_group(
    equations: Sequence[tuple[Tensor, Tensor]], L: int, ridge: float = RIDGE
) -> list[Tensor] | None:
    """The steps [K] of members that have one law; None where they are not positive definite.

    Args:
        equations: A [K, K] and b [K] of each member.
        L, ridge: as for `solve`.
    """
    if len(equations) == 1:
        x = solve(*equations[0], L, ridge)
        return None if x is None else [x]
    eliminated = []
    for A, b in equations:
        found = factor(A[:-L, :-L], 0, ridge)
        if found is None:
            return None
        sides = torch.cat([b[:-L, None], A[:-L, -L:]], 1) / found.scale[:, None]
        eliminated.append(torch.cholesky_solve(sides, found.factor) / found.scale[:, None])
    reduced = [
        torch.cat([b[-L:, None], A[-L:, -L:]], 1) - A[-L:, :-L] @ X
        for (A, b), X in zip(equations, eliminated, strict=True)
    ]
    both = torch.stack(reduced).sum(0)
    triangle, fault = torch.linalg.cholesky_ex(both[:, 1:])
    if int(fault):
        return None
    by_law = -torch.cholesky_solve(both[:, :1], triangle)[:, 0]
    return [torch.cat([-X[:, 0] - X[:, 1:] @ by_law, by_law]) for X in eliminated]


class Factor(NamedTuple):
    """A = scale factor factor^T scale, with the ridge: the scale [K] and a triangle [K, K]."""

    scale: Tensor
    factor: Tensor


def factor(A: Tensor, L: int, ridge: float = RIDGE) -> Factor | None:
    """The factors of normal equations; None where they are not positive definite. As `solve`."""
    scale = A.diagonal().sqrt().clamp_min(1e-30)
    scaled = A / scale / scale[:, None]
    scaled.diagonal()[: len(A) - L] += ridge
    triangle, fault = torch.linalg.cholesky_ex(scaled)
    return None if int(fault) else Factor(scale, triangle)
