"""The momentum balance, which needs no network, beside an identified law."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import cast

import numpy as np

from granpinn.config import Level, SideWalls
from granpinn.data import Flow
from granpinn.identification.once import Once
from granpinn.inspection.baseline import I0, baseline
from granpinn.inspection.confined import undetermined
from granpinn.physics.laws import Law
from granpinn.results import Parameters, Result
from granpinn.results.baseline import Baseline, Difference, Point
from granpinn.results.summary import friction_sd

CARRIED = "more than the base carries the grains, and the forces of walls are not known"


class Balance:
    """The momentum balance of a flow.

    Args:
        flow: as the training saw it, with added noise.
        side_walls: their friction, as the training took it.

    Attributes:
        at: the baseline with a law of an inertial scale.
    """

    def __init__(self, flow: Flow, side_walls: SideWalls | None = None) -> None:
        self.flow = flow
        self.at: Once[float, Baseline] = Once(lambda scale: baseline(flow, scale, side_walls))


def known_scale(law: Law, fixed: Mapping[str, float]) -> float | None:
    """The inertial scale of the balance beside a law; None if the training identifies it."""
    name = law.inertial_scale
    return I0 if name is None else fixed.get(name)


def beside(balance: Balance, result: Result) -> Baseline:
    """The baseline of a flow, and its differences from the law of a result."""
    name = result.friction_law.inertial_scale
    found = balance.at(I0 if name is None else result.parameters[name].value)
    if undetermined(balance.flow, cast(Level, result.level)) is not None:
        return found  # the network's law has no meaning
    differences = tuple(difference(point, result) for point in found.shown)
    return dataclasses.replace(found, network=differences)


def judged(result: Result, found: Baseline) -> Result:
    """The result with the baseline; no error bars where walls carry the grains.

    The equations hold there too, but nothing is known of the forces of the walls: the law was wrong
    by a factor of two in a silo (bench/studies/grains/note.md).
    """
    result = dataclasses.replace(result, baseline=found)
    if not found.carried:
        return result
    parameters = {
        name: dataclasses.replace(p, std=None, interval_90=None)
        for name, p in result.parameters.items()
    }
    return dataclasses.replace(
        result,
        parameters=Parameters(parameters),
        covariance=None,
        error_bars=None,
        law=dataclasses.replace(result.law, reason=CARRIED),
    )


def difference(point: Point, result: Result) -> Difference:
    """Without error bars of the result, the balance has all of the standard error."""
    at = np.array([point.I])
    mu = float(result.friction_law.friction(at, *result.theta)[0])
    sd = 0.0
    if result.covariance is not None:
        sd = float(friction_sd(at, result, result.covariance)[0])
    percent = 100 * (mu / point.mu - 1)
    se = 100 * float(np.hypot(sd / point.mu, mu * point.se / point.mu**2))
    return Difference(point.I, percent, se)
