"""The points of a fit where grains shear, which show the law, and the law over their I."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Floats
from granpinn.data import TrainingSet
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case, Model
from granpinn.fit.prediction import evaluate
from granpinn.results import Fields, Result
from granpinn.results.fields import D2_STAGNANT, shearing
from granpinn.uncertainty import curve
from granpinn.uncertainty.determined import applied, determined, percentiles, unfixed

POINTS = 16384  # at most, of those that give the range of I


class Shear(NamedTuple):
    """The points of the fit where grains shear, n of them.

    Attributes:
        I: inertial number [n].
        ratio: |tau|/p [n], or (|tau| - c)/p with a cohesion c; NaN where p <= 0.
    """

    I: Floats
    ratio: Floats


def shear_of(fields: Fields, cohesion: float = 0.0) -> Shear:
    """The points of the fields where grains shear.

    Args:
        cohesion: of the law, in the units of the fields.
    """
    points = shearing(fields)
    number, p, tau_xx, tau_xy = (
        fields.values[name][points].astype(np.float64) for name in ("I", "p", "tau_xx", "tau_xy")
    )
    return Shear(number, (np.hypot(tau_xx, tau_xy) - cohesion) / np.where(p > 0, p, np.nan))


def inertial_range(data: TrainingSet, model: Model) -> tuple[float, float] | None:
    """The 5th and the 95th percentile of I at the vectors that shear; None without shear.

    The velocity and the pressure are those of the network, at every k-th vector.
    """
    own = data.points[data.point_weights[:, 0] > 0]  # not of another variant
    points = own[:: max(1, len(own) // POINTS)].to(model.params)
    found = evaluate(points, model.spec, model.params, model.law, model.theta, model.physics)
    number = found["I"][found["D2"] >= D2_STAGNANT].cpu().double().numpy()
    return percentiles(number, np.ones(number.shape))


def with_curve(
    result: Result, case: Case, shear: Shear, ranges: Sequence[tuple[float, float]] = ()
) -> Result:
    """The result with its law over the I of the points that shear, and without the parameters that
    this range, or the walls, do not determine.

    The loss weights every point alike.

    Args:
        ranges: of I of all flows that have this law; (): this flow only.
    """
    weight = np.ones(shear.I.shape)
    reason = undetermined(case.seen, case.config.level)
    if reason is not None:
        result = applied(result, unfixed(result, shear.I, weight, reason))
    elif (found := determined(result, shear.I, weight, ranges)) is not None:
        result = applied(result, found)
    return curve.with_curve(result, shear.I, weight, shear.ratio)
