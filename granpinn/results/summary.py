"""Friction by the true law and the error of the identified one, at any I."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.physics.rheology import by_parameters
from granpinn.results.parameters import Covariance
from granpinn.results.result import Result

BAND_POINTS = 200  # of laws that are compared over a range of I
NORMAL_90 = 1.645  # half-width of the central 90 % of a normal distribution, in sd


def true_friction(result: Result, I: Floats) -> Float64 | None:
    """mu of the law that made the data, at I [n]; None if one of its parameters is unknown.

    A parameter with an unknown true value that was given in the identification counts as true.
    """
    truth = result.truth
    if truth is None:
        return None
    law, theta = truth.friction_law, []
    for name, true in zip(law.names, truth.theta, strict=True):
        given = result.parameters.get(name) if law.name == result.law.name else None
        if true is None and (given is None or not given.fixed):
            return None
        theta.append(float(true if true is not None or given is None else given.value))
    return np.asarray(law.friction(np.asarray(I, np.float64), *theta), np.float64)


def friction_sd(I: Floats, result: Result, covariance: Covariance) -> Floats:
    r"""Standard deviation of the law [n] from the covariance C of its parameters, to first order:

    $$ \sigma_\mu^2 = J\,C\,J^T, \quad J = \partial \mu / \partial \theta. $$
    """
    law = result.friction_law
    rows = by_parameters(law, np.asarray(I, np.float64), result.theta)
    J = rows[:, [law.names.index(name) for name in covariance.names]]
    variance = np.einsum("ni,ij,nj->n", J, np.array(covariance.matrix), J)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
