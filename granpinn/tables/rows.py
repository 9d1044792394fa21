"""From the members of a batch to the rows of a table: median, scatter and worst over the seeds.

A signed error is 100 (value - true)/true, an absolute one its size. **Scatter** is the standard
deviation of the identified value over the seeds relative to the true one, **worst** the largest
absolute error. RMSE is the root of the mean squared signed error, **bias** the mean signed error:
rmse^2 = bias^2 + scatter^2 (n - 1)/n. Trainings that diverged are counted, but have no part in
other numbers.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from granpinn.data import Flow, Truth
from granpinn.physics.laws import DEFAULT
from granpinn.results import Result
from granpinn.results.parameters import FIELD_ERRORS
from granpinn.tables.paper import PaperRow, row_1, row_2


class TableCase(NamedTuple):
    """A flow with a level of noise and a level of information, "V0" to "V2"."""

    flow: Flow
    noise: float
    level: str = "V1"

    @property
    def name(self) -> str:
        return self.flow.path.stem if self.flow.path else "in memory"


@dataclass(frozen=True)
class Spread:
    """Errors in % over the seeds; None where they are not known."""

    median: float | None
    worst: float | None
    scatter: float | None = None
    rmse: float | None = None
    bias: float | None = None
    signed_median: float | None = None


@dataclass(frozen=True)
class TableRow:
    """A case over its seeds.

    Attributes:
        fixed: values of the parameters that are held.
        values: medians of the identified parameters; None if all trainings diverged.
        errors: by the names of the identified parameters and `FIELD_ERRORS`.
        members: number of finished trainings; failed: number of diverged ones.
    """

    name: str
    noise: float
    level: str
    truth: Truth | None
    fixed: dict[str, float]
    n_points: int
    members: int
    failed: int
    values: dict[str, float | None]
    errors: dict[str, Spread]
    paper_1: PaperRow | None
    paper_2: PaperRow | None


def row_of(case: TableCase, results: Sequence[Result]) -> TableRow:
    """The row of a case from the results of all its seeds."""
    ended = [r for r in results if r.failure is None]
    truth, law = case.flow.truth, results[0].friction_law
    errors: dict[str, Spread] = {}
    medians: dict[str, float | None] = {}
    for name in law.free:
        values = [r.parameters[name].value for r in ended]
        medians[name] = statistics.median(values) if values else None
        errors[name] = _spread(values, getattr(truth, name, None))
    for name in FIELD_ERRORS:
        known = [r.error_percent[name] for r in ended]
        errors[name] = _of_sizes(value for value in known if value is not None)
    return TableRow(
        name=case.name,
        noise=case.noise,
        level=case.level,
        truth=truth,
        fixed={name: p.value for name, p in results[0].parameters.items() if p.fixed},
        n_points=results[0].data.n_points,
        members=len(ended),
        failed=len(results) - len(ended),
        values=medians,
        errors=errors,
        paper_1=row_1(truth, case.noise) if law is DEFAULT else None,
        paper_2=row_2(truth, case.noise) if law is DEFAULT else None,
    )


def _spread(values: Sequence[float], true: float | None) -> Spread:
    """Errors of identified values around the true one."""
    if not values or not true:
        return Spread(None, None)
    signed = [100 * (value - true) / true for value in values]
    sizes = [abs(error) for error in signed]
    return Spread(
        median=statistics.median(sizes),
        worst=max(sizes),
        scatter=statistics.stdev(signed) if len(signed) > 1 else None,
        rmse=math.sqrt(statistics.fmean(error**2 for error in signed)),
        bias=statistics.fmean(signed),
        signed_median=statistics.median(signed),
    )


def _of_sizes(sizes: Iterable[float]) -> Spread:
    """Statistics of errors without a sign."""
    known = list(sizes)
    if not known:
        return Spread(None, None)
    scatter = statistics.stdev(known) if len(known) > 1 else None
    return Spread(statistics.median(known), max(known), scatter)
