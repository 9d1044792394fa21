r"""The end of a training: Gauss-Newton steps in the last layer and the friction law.

The other layers are fixed, and the network is z = C h (`last_layer_sums.py`). A step minimizes the
loss of the training,

$$ \sum_k \frac{1}{2 n_k \sigma_k^2} \sum_i w_i^2 (r_{ik} + J_{ik} \delta)^2, $$

in all coefficients C [5, F] and the L free parameters of the law together, on many points at once.
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

bench/studies/last_layer has the measurements. Everything is dimensionless and float64.
"""

from __future__ import annotations

import dataclasses
import math
import time
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.training.features import Features, coefficients, with_coefficients
from granpinn.training.last_layer_sums import RIDGE, Sums, Unknowns, choose
from granpinn.training.law_variables import relative_change
from granpinn.training.objective import Member

HALVINGS = 4  # of a step that does not lower the loss
LONGEST = 0.1  # step of a free parameter or curve, relative: a longer one is not a correction
ITERATIONS = 16  # at most
SETTLED = 0.01  # relative change of a free parameter below which the law has settled


def iterate(sums: Sums, at: Unknowns, until: float = math.inf) -> Unknowns:
    """The unknowns after Gauss-Newton steps from `at`, until the law has settled.

    Every step has the weights of the law and its shares of the mean strain rate at its start. A
    curve takes one step. A further step is made only if it ends before time.monotonic() is `until`.
    """
    begin = time.monotonic()
    for k in range(1 if sums.law.curve else ITERATIONS):
        now = time.monotonic()
        if k > 0 and now + (now - begin) / k > until:
            break
        sums.weigh_anew()
        before, at = at, improve(sums, at)
        if relative_change(sums.law, before.theta, at.theta) <= SETTLED:
            break
    return at


def improve(sums: Sums, at: Unknowns) -> Unknowns:
    """The unknowns after a Gauss-Newton step from `at`.

    A step that would change the law by more than `LONGEST` changes it by that; the coefficients of
    the network then go to the best values for that law. While a step does not lower the loss, it is
    halved, at most `HALVINGS` times. If all fail, the result is `at`.
    """
    free, law, theta, n = sums.free, sums.law, at.theta, at.C.numel()
    before = sums.loss(at)
    with torch.enable_grad():
        A, b = sums.normal_equations(at)
        if len(sums.differences):
            before += sums.expect_smooth(A, b, at)
        found = factor(A, len(free))
    if found is None:
        return at
    step, whole = found.solve(-b), theta.clone()
    whole[free] += step[n:]
    change = relative_change(law, theta, whole)
    if change > LONGEST:
        left = (1 - LONGEST / change) * step[n:]
        step = step - torch.cat([found.leading(n).solve(-A[:n, n:]) @ left, left])
    for part in (0.5**halving for halving in range(HALVINGS + 1)):
        moved = theta.clone()
        moved[free] += part * step[n:]
        after = Unknowns(at.C + (part * step[:n]).view_as(at.C), moved)
        if law.admits(moved.tolist()) and sums.loss(after) < before:  # not for a NaN
            return after
    return at


def last_layer(
    member: Member, params: Tensor, theta: Tensor, step: int, until: float = math.inf
) -> tuple[Tensor, Tensor]:
    """params [P] and theta [N] of a trained network of the mixed form after the steps, if any.

    Args:
        member: with the term weights of the end of the training, and data on the device of
            `params`; its seed and `step` choose the points.
        until: time.monotonic() after which no further step is made.
    """
    spec = member.problem.spec
    features = Features(spec, params, member.problem.window)
    sums = Sums(
        features, member.problem, member.law, choose(member.data, features, member.seed, step)
    )
    found = iterate(sums, Unknowns(coefficients(spec, params), theta.double()), until)
    return with_coefficients(spec, params, found.C), found.theta.to(theta)


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


class Factor(NamedTuple):
    """A = scale factor factor^T scale, with the ridge: the scale [K] and a triangle [K, K]."""

    scale: Tensor
    factor: Tensor

    def solve(self, sides: Tensor) -> Tensor:
        """A^-1 of sides [K] or [K, m]."""
        columns = sides.reshape(len(sides), -1) / self.scale[:, None]
        found = torch.cholesky_solve(columns, self.factor) / self.scale[:, None]
        return found.view_as(sides)

    def leading(self, n: int) -> Factor:
        """That of the first n rows and columns of A."""
        return Factor(self.scale[:n], self.factor[:n, :n])


def factor(A: Tensor, L: int, ridge: float = RIDGE) -> Factor | None:
    """The factors of normal equations; None where they are not positive definite.

    Args:
        L: number of parameters of the law, the last ones of the K unknowns.
        ridge: added to the unit diagonal of the scaled equations for C. The hidden units are nearly
            dependent; the ridge keeps a step small in directions that no data determine.
    """
    scale = A.diagonal().sqrt().clamp_min(1e-30)
    scaled = A / scale / scale[:, None]
    scaled.diagonal()[: len(A) - L] += ridge
    triangle, fault = torch.linalg.cholesky_ex(scaled)
    return None if int(fault) else Factor(scale, triangle)
