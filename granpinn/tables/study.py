"""All cases with all seeds as one batch, and their results."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from granpinn.config import Config
from granpinn.identification.batch import identify_many
from granpinn.physics.laws import LAWS, FrictionLaw
from granpinn.results import Result
from granpinn.tables.paper import NOISY_CASE, case_of
from granpinn.tables.rows import TableCase, TableRow
from granpinn.training.progress import Progress

I0_UNKNOWN = 0.3  # the paper's I0


@dataclass(frozen=True)
class Study:
    """Rows in the order of the cases, and the time of the batches.

    Attributes:
        training_s: training alone, by level; total_s: with reading, scoring and writing.
    """

    config: Config
    seeds: int
    rows: list[TableRow]
    training_s: dict[str, float]
    total_s: float

    @property
    def law(self) -> FrictionLaw:
        return LAWS[self.config.law]

    @property
    def levels(self) -> list[str]:
        return list(self.training_s)


def cases_of(cases: Sequence[TableCase], noise: Sequence[float], on: str) -> list[TableCase]:
    """Every case without noise if 0 is among its levels, and the noisy cases at the others.

    Args:
        cases: one of each flow.
        on: "all", or "reference" for the paper's noisy case alone where it is among the flows.
    """
    noisy = [case for case in cases if case_of(case.flow.truth) == NOISY_CASE]
    if on == "all" or not noisy:
        noisy = list(cases)
    clean = list(cases) if 0 in noise else []
    return clean + [case._replace(noise=sd) for case in noisy for sd in noise if sd > 0]


def run(
    cases: Sequence[TableCase],
    config: Config,
    seeds: int,
    I0: float | None,
    folder: Path,
    progress: Progress | None = None,
) -> Study:
    """Train everything side by side, one batch for each level of information.

    Args:
        cases: sorted by level.
        I0: for all; None for the I0 of each flow file.
        folder: for checkpoints and results of the members; `config.resume` continues from there.
    """
    begin = time.monotonic()
    many = len({case.level for case in cases}) > 1
    groups: list[Sequence[Result]] = []
    training_s = {}
    for level, these in itertools.groupby(cases, lambda case: case.level):
        own = dataclasses.replace(config, level=level)
        place = folder / level if many else folder
        found = _train(list(these), own, seeds, I0, place, progress)
        groups += [found[k : k + seeds] for k in range(0, len(found), seeds)]
        training_s[level] = max(r.timing.wall_s for r in found)
    rows = [TableRow(case, group) for case, group in zip(cases, groups, strict=True)]
    config = dataclasses.replace(config, out=None, flow=None)
    return Study(config, seeds, rows, training_s, time.monotonic() - begin)


def batches(count: int) -> str:
    """The number of batches, in words."""
    return "one batch" if count == 1 else f"{count} batches"


def _train(
    cases: Sequence[TableCase],
    config: Config,
    seeds: int,
    I0: float | None,
    folder: Path,
    progress: Progress | None,
) -> Sequence[Result]:
    """Train one batch: every case with all its seeds."""
    many = [case for case in cases for _ in range(seeds)]
    return identify_many(
        [case.flow for case in many],
        config,
        [config.seed + k for _ in cases for k in range(seeds)],
        I0=[I0 or getattr(case.flow.truth, "I0", None) or I0_UNKNOWN for case in many],
        noise=[case.noise for case in many],
        run_dir=folder,
        progress=progress,
    )
