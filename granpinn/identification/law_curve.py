"""The curve of an identified law, from the fields of the fit."""

from __future__ import annotations

import numpy as np

from granpinn.identification import scoring
from granpinn.results import Fields, NotDone, Result
from granpinn.results.attempt import LAW_CURVE, attempt, having, lacking
from granpinn.uncertainty.curve import with_curve


def with_law_curve(result: Result, fields: Fields) -> Result:
    """The result with its law over the I of the points that shear; the loss weights all alike."""

    def made() -> Result:
        points = scoring.shearing(fields)
        number, p, tau_xx, tau_xy = (
            fields.values[name][points].astype(np.float64)
            for name in ("I", "p", "tau_xx", "tau_xy")
        )
        positive = np.where(p > 0, p, np.nan)
        return with_curve(
            result, number, np.ones(number.shape), np.hypot(tau_xx, tau_xy) / positive
        )

    found = attempt(LAW_CURVE, made)
    return lacking(result, found) if isinstance(found, NotDone) else having(found, LAW_CURVE)
