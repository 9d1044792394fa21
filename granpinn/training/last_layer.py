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
Data may contradict the mean (`mean_rate.py`).

bench/studies/last_layer has the measurements. Everything is dimensionless and float64.
"""

from __future__ import annotations

import math
import time

import torch
from torch import Tensor

from granpinn.training.elimination import solve
from granpinn.training.features import Features, coefficients, with_coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.law_variables import relative_change
from granpinn.training.objective import Member

HALVINGS = 4  # of a step that does not lower the loss, or is too long
LONGEST = 0.1  # step of a free parameter or curve, relative: a longer one is not a correction
ITERATIONS = 8  # at most
SETTLED = 0.01  # relative change of a free parameter below which the law has settled


def iterate(sums: Sums, at: Unknowns, until: float = math.inf) -> Unknowns:
    """The unknowns after Gauss-Newton steps from `at`, until the law has settled.

    Every step has the weights of the law at its start. A curve takes one step. A further step is
    made only if it ends before time.monotonic() is `until`.
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

    While a step does not lower the loss or is too long, it is halved, at most `HALVINGS` times. If
    all fail, the result is `at`.
    """
    free, law = sums.free, sums.law
    before = sums.loss(at)
    with torch.enable_grad():
        A, b = sums.normal_equations(at)
        if len(sums.differences):
            before += sums.expect_smooth(A, b, at)
        x = solve(A, b, len(free))
    if x is None:
        return at
    for part in (x * 0.5**halving for halving in range(HALVINGS + 1)):
        by_C, by_law = part[: at.C.numel()], part[at.C.numel() :]
        theta = at.theta.clone()
        theta[free] += by_law
        found = Unknowns(at.C + by_C.view_as(at.C), theta)
        short = relative_change(law, at.theta, theta) <= LONGEST
        if short and law.admits(theta.tolist()) and sums.loss(found) < before:  # not for a NaN
            return found
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
    points = choose(member.data, features, member.seed, step)
    sums = Sums(features, member.problem, member.law, points)
    found = iterate(sums, Unknowns(coefficients(spec, params), theta.double()), until)
    return with_coefficients(spec, params, found.C), found.theta.to(theta)
