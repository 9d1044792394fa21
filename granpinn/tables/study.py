"""All cases with all seeds as one batch, and what came out of it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from granpinn.config import Config
from granpinn.identification.ensemble import identify_many
from granpinn.results import Result
from granpinn.tables.paper import NOISY_CASE, case_of
from granpinn.tables.rows import Case, Row, row_of
from granpinn.training.progress import Progress

I0_UNKNOWN = 0.3  # that of the paper


@dataclass(frozen=True)
class Study:
    """Rows in the order of the cases, the result of every training, and the time of the batch.

    Attributes:
        results: of every case, its seeds in order.
        training_s: training alone; total_s: with reading, scoring and writing.
    """

    config: Config
    seeds: int
    rows: list[Row]
    results: list[list[Result]]
    training_s: float
    total_s: float


def cases_of(cases: Sequence[Case], levels: Sequence[float], on: str) -> list[Case]:
    """Every flow without noise if 0 is a level, and the noisy cases at the other levels.

    Args:
        cases: one of each flow.
        on: "all", or "reference" for the paper's noisy case alone where it is among the flows.
    """
    noisy = [case for case in cases if case_of(case.flow.truth) == NOISY_CASE]
    if on == "all" or not noisy:
        noisy = list(cases)
    clean = [Case(case.flow, 0.0) for case in cases] if 0 in levels else []
    return clean + [Case(case.flow, sd) for case in noisy for sd in levels if sd > 0]


def run(
    cases: Sequence[Case],
    config: Config,
    seeds: int,
    I0: float | None,
    folder: Path,
    progress: Progress | None = None,
) -> Study:
    """Train everything side by side.

    Args:
        I0: for all; None for that of each flow file.
        folder: for the checkpoints and the results of the members; `config.resume` goes on there.
    """
    begin = time.monotonic()
    many = [case for case in cases for _ in range(seeds)]
    found = identify_many(
        [case.flow for case in many],
        config,
        [config.seed + k for _ in cases for k in range(seeds)],
        I0=[I0 or (case.flow.truth and case.flow.truth.I0) or I0_UNKNOWN for case in many],
        noise=[case.noise for case in many],
        run_dir=folder,
        keep_fields=False,
        progress=progress,
    )
    groups = [found[k : k + seeds] for k in range(0, len(found), seeds)]
    rows = [row_of(case, group) for case, group in zip(cases, groups, strict=True)]
    training_s = max(r.timing.wall_s for r in found)
    config = dataclasses.replace(config, out=None, flow=None)
    return Study(config, seeds, rows, groups, training_s, time.monotonic() - begin)
