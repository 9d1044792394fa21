"""mu(I) with I0 free, from a training with a given I0.

The last layer and the law are solved once more, with I0 as a third unknown. The law then has the
slope and the curvature that the data want. It is kept as log mu at three I: at both ends of the
range of the data, and between.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from granpinn.fit.free_curve import LEAST
from granpinn.physics.laws import DEFAULT
from granpinn.physics.rheology import by_parameters
from granpinn.results.records import LawPoints
from granpinn.training.information import information
from granpinn.training.last_layer import last_layer
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.curve_error import quadratic
from granpinn.uncertainty.error_model import Pair

# Errors over the standard deviations that the residuals show (bench/studies/one_law/note.md).
SCATTER = 4.0


def law_points(run: TrainingLoop, place: int, I_range: Pair) -> LawPoints | None:
    """The law of a member of a run; None where the data do not determine three parameters.

    Args:
        I_range: of the data, 5th and 95th percentile.
    """
    ended = run.trainer.ended(place)
    if ended is None or I_range[0] == I_range[1]:
        return None
    member, params, theta, step = ended
    law = DEFAULT.with_free({"I0": float(theta[DEFAULT.names.index("I0")])})
    member = dataclasses.replace(member, law=law)
    params, theta = last_layer(member, params, theta, step)
    found = information(member, params, theta, step)
    known = None if found is None else quadratic(found, len(law.free))
    if known is None:
        return None
    I, values = np.geomspace(*I_range, 3), theta.double().cpu().numpy()
    mu = law.friction(I, *values)
    slopes = by_parameters(law, I, values) / mu[:, None]
    C = SCATTER**2 * slopes @ known.covariance @ slopes.T + LEAST**2 * np.eye(len(I))
    return LawPoints(tuple(I.tolist()), tuple(np.log(mu).tolist()), tuple(map(tuple, C.tolist())))
