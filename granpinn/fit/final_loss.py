"""The loss at the end of a training, over many points: the same ones for members of one flow.

The loss of a step is over a small batch. Its scatter hides the differences between two laws. Points
of the equations above the highest vectors are left out: no vector holds the velocity there, so
their residuals say nothing about the law.
"""

from __future__ import annotations

import math

import torch

from granpinn.physics.terms import NAMES
from granpinn.results.loss import Loss
from granpinn.training.trainer import Trainer

MOST_POINTS = 131072
CHUNK = 16384  # points per evaluation


@torch.no_grad()
def final_loss(trainer: Trainer, member: int) -> Loss | None:
    """Mean terms of a member after the steps of the training (`Trainer.trained`).

    The mean is over every k-th point, at most `MOST_POINTS`, without those of the strip, which are
    pooled behind the vectors and the points between them. None if a term is not finite.
    """
    objective, e = trainer.objective, member
    params, theta = trainer.trained(e)
    data = objective.data(e)
    own = objective.members[e].data
    first, strip = len(own.points) + len(own.between), len(own.strip)
    inside = _every_kth(len(data.points) - strip)
    inside[inside >= first] += strip
    surface = _every_kth(len(data.surface_points))
    sums = [0.0] * len(NAMES)
    weights = data.point_weights[inside.to(data.points.device)].double().mean(0).tolist()
    for start in range(0, max(len(inside), len(surface)), CHUNK):
        i, j = (k[start : start + CHUNK].to(data.points.device) for k in (inside, surface))
        terms = objective.terms(e, params, theta, data.loss_points.at(i, j))
        for k, (name, term) in enumerate(zip(NAMES, terms.tolist(), strict=True)):
            sums[k] += term * len(j if name == "surface" else i)
    velocity, equations = (len(inside) * weight for weight in weights)
    counts = dict.fromkeys(NAMES, equations)
    counts |= {"velocity": velocity, "surface": max(1, len(surface))}
    means = [total / counts[name] for total, name in zip(sums, NAMES, strict=True)]
    if not all(map(math.isfinite, means)):
        return None
    return Loss(len(inside), _named(means), _named(trainer.final_weights(e)))


def _named(values: list[float]) -> dict[str, float]:
    return dict(zip(NAMES, values, strict=True))


def _every_kth(count: int) -> torch.Tensor:
    """At most `MOST_POINTS` of the numbers below `count`, spread evenly."""
    return torch.arange(0, count, max(1, -(-count // MOST_POINTS)))
