"""What a trained law is worth, after its error bars: the momentum balance beside it, the parameters
that the range of I determines, its curve, and the comparison with other laws.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Floats
from granpinn.identification import balance, comparison
from granpinn.identification.case import Case
from granpinn.identification.law_curve import Shear, with_law_curve
from granpinn.inspection.confined import undetermined
from granpinn.results import NotDone, Result
from granpinn.results.attempt import (
    BASELINE,
    COMPARISON,
    DETERMINED,
    LAW_CURVE,
    attempt,
    having,
    lacking,
)
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.determined import applied, determined, unfixed


def with_law(
    result: Result,
    case: Case,
    run: TrainingLoop,
    place: int,
    shear: Shear | NotDone | None,
    of_laws: dict[str, int],
) -> Result:
    """The result with all of these.

    Args:
        place: of the member of the result in the run.
        shear: the points where grains shear; None without fields.
        of_laws: place in the run of every law of a comparison.
    """
    result = _with_baseline(result, case)
    if isinstance(shear, NotDone):
        result = having(lacking(result, shear), LAW_CURVE)
    elif shear is not None:
        result = with_law_curve(_with_range(result, case, shear.I), shear)
    if case.config.compare_laws:
        result = _with_laws_compared(result, case, run, of_laws)
    # A comparison that was made has given the band too.
    return result if result.comparison else _with_free_band(result, case, run, place)


def _with_free_band(result: Result, case: Case, run: TrainingLoop, place: int) -> Result:
    """The result with the band of its curve, if its law is the free curve."""
    made = attempt(LAW_CURVE, lambda: comparison.with_free_band(result, case, run, place))
    return lacking(result, made) if isinstance(made, NotDone) else made


def _with_laws_compared(
    result: Result, case: Case, run: TrainingLoop, of_laws: dict[str, int]
) -> Result:
    """The result with the comparison of laws, or why there is none."""

    def made() -> Result:
        if (reason := undetermined(case.seen, case.config.level)) is not None:
            raise comparison.ComparisonError(reason)
        return comparison.compared(result, case, run, of_laws)

    found = attempt(COMPARISON, made)
    return lacking(result, found) if isinstance(found, NotDone) else having(found, COMPARISON)


def _with_range(result: Result, case: Case, number: Floats) -> Result:
    """The result without the parameters that its range of I, or its walls, do not determine.

    Args:
        number: I of the grains that shear [n]; the loss weights every vector alike.
    """

    def of_shear() -> Result:
        weight, reason = np.ones(number.shape), undetermined(case.seen, case.config.level)
        if reason is not None:
            return applied(result, unfixed(result, number, weight, reason))
        found = determined(result, number, weight)
        return result if found is None else applied(result, found)

    made = attempt(DETERMINED, of_shear)
    return lacking(result, made) if isinstance(made, NotDone) else having(made, DETERMINED)


def _with_baseline(result: Result, case: Case) -> Result:
    """The result with the momentum balance beside it."""
    found = attempt(BASELINE, lambda: balance.beside(case.balance, result))
    if isinstance(found, NotDone):
        return lacking(result, found)
    return having(balance.judged(result, found), BASELINE)
