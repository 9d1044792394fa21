"""The relative error of a field."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Floats


def relative_l2(predicted: Floats, reference: Floats) -> float | None:
    """eq. (errorL2) in %, over everything in the arrays (a vector field: all components).

    None without points, or if the reference is zero everywhere.
    """
    predicted, reference = (np.asarray(f, np.float64) for f in (predicted, reference))
    size = float(np.sum(reference**2))
    if size == 0.0:
        return None
    return 100.0 * float(np.sqrt(np.sum((predicted - reference) ** 2) / size))
