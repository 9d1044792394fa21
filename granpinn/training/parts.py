r"""The friction law on parts of the data: one Gauss-Newton step with a law for each half.

As in the last-layer step (`last_layer.py`), the outputs of the last hidden layer are given
functions, and the loss of the training is minimised in the coefficients C and the law. Here the
second half of a split has a law of its own, theta + delta. The step gives delta, with the last
layer of the velocity shared by both halves; `splits.py` says what follows for the stress.

**Error of delta.** With the residuals r at the solution and $Q = A^{-1} J^T$, the errors of the
unknowns are sums over residuals, $\sum_i Q_i r_i$. Neighbors share their errors. So the sum is
taken over boxes in space and time, and the boxes count as independent,

$$ \mathrm{cov} = \sum_B \Big(\sum_{i \in B} Q_i r_i\Big) \Big(\sum_{i \in B} Q_i r_i\Big)^T . $$

This is the sandwich of White (Econometrica 48, 1980) for clusters. Small and large boxes are taken;
the larger error counts (uncertainty/of_parts.py).

Everything but the result is dimensionless, and all is float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.physics.rheology import inertial_number
from granpinn.training.boxes import Boxes
from granpinn.training.equations import SMOOTHING
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.objective import Member
from granpinn.training.parts_system import System
from granpinn.training.splits import quantiles, splits_of

FEWER = 4  # times fewer points than in the last-layer step
BOXES = (8, 4)  # along each axis


@dataclass(frozen=True)
class HalfLaws:
    """The law on both halves of the data.

    Attributes:
        name: of the split.
        theta: parameters of the law on the first and on the second half [2, N], in the units of
            the flow file.
        influence: for each size of boxes, what every box adds to the error of the free parameters
            of both halves [B, 2, L].
        I: inertial number, 5th and 95th percentile on each half [2, 2].
        share: of what the data tell of the law [2].
    """

    name: str
    theta: Tensor
    influence: tuple[Tensor, ...]
    I: Tensor  # noqa: E741 (the inertial number's own symbol)
    share: Tensor


def laws_on_parts(member: Member, params: Tensor, theta: Tensor, step: int) -> list[HalfLaws]:
    """The laws on the halves of every split of a trained network of the mixed form.

    Splits whose equations cannot be solved are left out.

    Args:
        member, params, theta, step: as for `last_layer.last_layer`, after that step.
    """
    spec = member.problem.spec
    features = Features(spec, params)
    data = choose(member.data, features, member.seed, step, FEWER)
    sums = Sums(features, member.problem, member.law, data)
    at = Unknowns(coefficients(spec, params), theta.double())
    sums.loss(at)  # fixes the weights of the law
    shear = _shear(sums, at)
    periodic = member.flow is not None and member.flow.periodic
    x, y, t = (factor != 0 for factor in spec.input_scale)
    splits = splits_of(data.points, shear.gamma_dot, shear.told, (x and not periodic, y, t))
    system = System(sums, at, splits)
    with torch.enable_grad():
        system.add_equations()
        system.find_roughness()
    solved = [system.solve(k) for k in range(len(splits))]
    kept = [k for k, found in enumerate(solved) if found is not None]
    solutions = [found for found in solved if found is not None]
    if not kept:
        return []
    boxes = [Boxes(member.data.lower, member.data.upper, count) for count in BOXES]
    influence = system.influence(kept, solutions, boxes)
    found = []
    L, free = len(sums.free), sums.free
    for k, (x_k, _), own in zip(kept, solutions, influence, strict=True):
        both = at.theta.expand(2, -1).clone()
        both[:, free] += x_k[-2 * L : -L]
        both[1, free] += x_k[-L:]
        second = splits[k].second
        halves = [~second, second]
        ranges = [quantiles(shear.I[half], shear.told[half], [0.05, 0.95]) for half in halves]
        share = torch.stack([shear.told[half].sum() for half in halves]) / shear.told.sum()
        unit = member.problem.pressure_unit
        both = both.new_tensor([member.law.to_physical(half, unit) for half in both.tolist()])
        found.append(HalfLaws(splits[k].name, both, own, torch.stack(ranges), share))
    return found


class _Shear(NamedTuple):
    """At the points of the equations [N]: shear rate, I, and what they tell of the law.

    The last is the sum of the squared slopes of the two residuals of the law by the relative
    friction, up to the ratio of |tau| to mu p.
    """

    gamma_dot: Tensor
    I: Tensor  # noqa: E741
    told: Tensor


@torch.no_grad()
def _shear(sums: Sums, at: Unknowns) -> _Shear:
    physics, rates, pressures = sums.physics, [], []
    for h in sums.h:
        z = h @ at.C.T
        (u, v), U = z[:, :, :2].unbind(2), physics.velocity_scale
        rates.append(U * torch.sqrt((u[1] - v[2]) ** 2 + (u[2] + v[1]) ** 2 + SMOOTHING))
        pressures.append(physics.pressure_scale * torch.nn.functional.softplus(z[0, :, 2]))
    gamma_dot, p = torch.cat(rates), torch.cat(pressures)
    number = inertial_number(gamma_dot, p, physics.grain_diameter, physics.pressure_floor)
    slope = sums.law_weight * gamma_dot * (1 + (gamma_dot / physics.law_rate) ** 2).rsqrt()
    return _Shear(gamma_dot, number, slope**2)
