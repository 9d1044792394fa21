"""Where the line of the free surface has no single height: it is vertical there, or folds."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Bool, Float64, Floats

STEEP = 2.0  # slope of the line from which it has no single height within a cell


def folded(along: Float64, line_along: Floats, line_up: Floats) -> Bool:
    """Columns of cells in which the points of a line differ by more than `STEEP` cells in height.

    The points have no order, as in a flow file.

    Args:
        along: places of the columns along the ground [X], increasing.
        line_along, line_up: points of the line at one time [n].

    Returns:
        [X].
    """
    middle = (along[1:] + along[:-1]) / 2
    column = np.searchsorted(middle, line_along)
    low, high = np.full(along.size, np.inf), np.full(along.size, -np.inf)
    np.minimum.at(low, column, line_up)
    np.maximum.at(high, column, line_up)
    return np.asarray(high - low > STEEP * float(np.median(np.diff(along))))
