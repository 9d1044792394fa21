"""Do the data contradict the mean strain rate of the last-layer step?

Where mu(I) is ill-posed, simulated grids and grains obey it in the mean over a band, and the step
has a mean strain rate there (`equations.py`). Other flows obey it at every point: those of exact
solutions, or of materials whose bands are thick. If such data are resolved well enough to show it,
the loss of the trained network is several times as large with the mean as without. Otherwise the
two losses are nearly equal, and the mean stays. bench/studies/floor has the measurements.
"""

from __future__ import annotations

import dataclasses

from torch import Tensor

from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.objective import Member

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
