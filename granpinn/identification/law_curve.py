"""The curve of an identified law, from the fields of the fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granpinn.arrays import Floats
from granpinn.results import Fields, NotDone, Result
from granpinn.results.attempt import LAW_CURVE, attempt, having, lacking
from granpinn.results.zones import shearing
from granpinn.uncertainty.curve import with_curve


class Shear(NamedTuple):
    """The points of the fit where grains shear, n of them.

    Attributes:
        I: inertial number [n].
        ratio: |tau|/p [n], or (|tau| - c)/p with a cohesion c; NaN where p <= 0.
    """

    I: Floats  # noqa: E741
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


def with_law_curve(result: Result, shear: Shear | Fields) -> Result:
    """The result with its law over the I of the points that shear; the loss weights all alike.

    Args:
        shear: these points, or the fields that hold them.
    """

    def made() -> Result:
        points = shear
        if isinstance(points, Fields):
            points = shear_of(points, result.friction_law.cohesion_of(result.theta))
        return with_curve(result, points.I, np.ones(points.I.shape), points.ratio)

    found = attempt(LAW_CURVE, made)
    return lacking(result, found) if isinstance(found, NotDone) else having(found, LAW_CURVE)
