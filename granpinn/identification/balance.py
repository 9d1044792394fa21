"""The momentum balance, which needs no network, beside an identified law."""

from __future__ import annotations

import dataclasses

import numpy as np

from granpinn.data import Flow
from granpinn.inspection.baseline import I0, baseline
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.baseline import Baseline, Difference, Point
from granpinn.results.summary import friction_sd

STANDARD_ERRORS = 2.0  # of a difference that warns


def beside(flow: Flow, result: Result) -> Baseline:
    """The baseline of a flow, and its differences from the law of a result.

    Args:
        flow: as the training saw it, with added noise.
    """
    name = LAWS[result.law].inertial_scale
    found = baseline(flow, I0 if name is None else result.parameters[name].value)
    differences = tuple(_difference(point, result) for point in found.shown)
    return dataclasses.replace(found, network=differences)


def _difference(point: Point, result: Result) -> Difference:
    """Without error bars of the result, the balance has all of the standard error."""
    at = np.array([point.I])
    mu = float(LAWS[result.law].friction(at, *result.theta)[0])
    sd = 0.0
    if result.covariance is not None:
        sd = float(friction_sd(at, result, result.covariance)[0])
    percent = 100 * (mu / point.mu - 1)
    se = 100 * float(np.hypot(sd / point.mu, mu * point.se / point.mu**2))
    return Difference(point.I, percent, se, abs(percent) > STANDARD_ERRORS * se)
