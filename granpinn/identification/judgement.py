"""What a trained law is worth, after its error bars: the momentum balance beside it, the parameters
that the range of I determines, its curve, and the comparison with other laws.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Floats
from granpinn.data.flow import SOLVER_CELL
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
from granpinn.uncertainty import of_kind
from granpinn.uncertainty.determined import applied, determined, range_of, unfixed


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
    kind = _kind(result, case)
    made = attempt(LAW_CURVE, lambda: comparison.with_free_band(result, case, run, place, kind))
    return lacking(result, made) if isinstance(made, NotDone) else made


def _with_laws_compared(
    result: Result, case: Case, run: TrainingLoop, of_laws: dict[str, int]
) -> Result:
    """The result with the comparison of laws, or why there is none."""

    def made() -> Result:
        if (reason := undetermined(case.seen, case.config.level)) is not None:
            raise comparison.ComparisonError(reason)
        return comparison.compared(result, case, run, of_laws, _kind(result, case))

    found = attempt(COMPARISON, made)
    return lacking(result, found) if isinstance(found, NotDone) else having(found, COMPARISON)


def _with_range(result: Result, case: Case, number: Floats) -> Result:
    """The result without the parameters that its range of I, or its walls, do not determine.

    Kinds of flows with a known model error get their error bars first.

    Args:
        number: I of the grains that shear [n]; the loss weights every vector alike.
    """

    def of_shear() -> Result:
        weight, reason = np.ones(number.shape), undetermined(case.seen, case.config.level)
        if reason is not None:
            return applied(result, unfixed(result, number, weight, reason))
        made = _with_model_error(result, case, number)
        found = determined(made, number, weight)
        return made if found is None else applied(made, found)

    made = attempt(DETERMINED, of_shear)
    return lacking(result, made) if isinstance(made, NotDone) else having(made, DETERMINED)


def _with_model_error(result: Result, case: Case, number: Floats) -> Result:
    """The result with the error bars of its kind of flow; `number`: I of the grains that shear."""
    if (I0 := result.parameters.get("I0")) is None:
        return result
    shear = range_of(number, np.ones(number.shape), I0.value)
    if shear is None:
        return result
    return of_kind.with_model_error(result, case.config, _kind(result, case), shear)


def _kind(result: Result, case: Case) -> str | None:
    carried = result.baseline is not None and result.baseline.carried
    return of_kind.kind_of(
        result.data.symmetries, carried, case.flow.stated(SOLVER_CELL) is not None
    )


def _with_baseline(result: Result, case: Case) -> Result:
    """The result with the momentum balance beside it."""
    found = attempt(BASELINE, lambda: balance.beside(case.balance, result))
    if isinstance(found, NotDone):
        return lacking(result, found)
    return having(balance.judged(result, found), BASELINE)
