"""The rows of the tables: a case with all its seeds, and the statistics over them.

Trainings that diverged are counted, but have no part in a statistic.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from granpinn.data import Flow
from granpinn.physics.laws import DEFAULT
from granpinn.results import Result
from granpinn.tables.paper import PaperRow, row_1, row_2


class TableCase(NamedTuple):
    """A flow with a level of noise and a level of information, "V0" to "V2"."""

    flow: Flow
    noise: float
    level: str = "V1"

    @property
    def name(self) -> str:
        """The true parameters, such as (0.40, 0.64), where all are known; else the file's name."""
        truth = self.flow.truth
        true = [None] if truth is None else [getattr(truth, n) for n in truth.friction_law.free]
        if None not in true:
            return f"({', '.join(f'{value:.2f}' for value in true)})"
        return self.flow.path.stem if self.flow.path else "in memory"


@dataclass(frozen=True)
class TableRow:
    """A case and the results of all its seeds."""

    case: TableCase
    results: Sequence[Result]

    @property
    def ended(self) -> list[Result]:
        return [r for r in self.results if r.failure is None]

    @property
    def failed(self) -> int:
        return len(self.results) - len(self.ended)

    def value(self, name: str) -> float | None:
        """Median of an identified parameter."""
        values = [r.parameters[name].value for r in self.ended]
        return statistics.median(values) if values else None

    def error(self, name: str) -> tuple[float | None, float | None]:
        """Median and largest absolute error of a parameter or a field, in %."""
        errors = [e for r in self.ended if (e := r.error_percent.get(name)) is not None]
        return (statistics.median(errors), max(errors)) if errors else (None, None)

    def scatter(self, name: str) -> float | None:
        """Standard deviation of a parameter over the seeds, in % of the true one."""
        values, true = [r.parameters[name].value for r in self.ended], self.case.flow.truth
        known = getattr(true, name, None)
        return 100 * statistics.stdev(values) / known if known and len(values) > 1 else None

    def paper(self, table: int) -> PaperRow | None:
        """The row of the paper in its table 1 or 2, if it has one."""
        if self.results[0].law.name != DEFAULT.name:
            return None
        return (row_1, row_2)[table - 1](self.case.flow.truth, self.case.noise)
