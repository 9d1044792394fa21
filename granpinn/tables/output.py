"""The tables as text and HTML, and every training as a row of a CSV file."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import NamedTuple

from granpinn.config import flatten
from granpinn.output import write_text
from granpinn.output.table import Table
from granpinn.report.page import duration, template
from granpinn.results import number
from granpinn.results.results_file import row as cells_of
from granpinn.results.results_file import write_table
from granpinn.tables.paper import SOURCE_1, SOURCE_2, VELOCITY_ALONE, PaperRow
from granpinn.tables.rows import TableRow
from granpinn.tables.study import Study, batches

# Fields whose errors have a column without a number of the paper.
FIELDS = {
    "pressure_flowing": "flowing",
    "pressure_stagnant": "at rest",
    "pressure_simulated": "simulated",
    "velocity": "velocity",
}


class PaperTable(NamedTuple):
    """A table beside that of the paper, whose source the note names."""

    title: str
    note: str
    table: Table


def tables_of(study: Study) -> list[PaperTable]:
    """For each level of information, table 1: flows without noise; table 2: flows with noise, and
    the same flows without noise if they were trained.
    """
    noisy = {row.case.name for row in study.rows if row.case.noise > 0}
    rows_1 = [row for row in study.rows if row.case.noise == 0]
    rows_2 = [row for row in study.rows if row.case.name in noisy]
    rows_2.sort(key=lambda row: (row.case.name, row.case.noise))
    free = study.law.free
    head = ["case", "noise", *free]
    head += [title for name in (*free, "p") for title in (f"{name} %", "paper")]
    head += [*FIELDS.values(), "scatter %", "seeds"]
    tables = []
    for k, title, source, rows in (
        (1, "Table 1: identification without noise", SOURCE_1, rows_1),
        (2, "Table 2: identification with noise", SOURCE_2, rows_2),
    ):
        for level in sorted({row.case.level for row in rows}):
            own = [_cells(row, free, row.paper(k)) for row in rows if row.case.level == level]
            note = f"{source}; {VELOCITY_ALONE}" if level == "V0" else source
            tables.append(PaperTable(f"{title}, level {level}", note, Table(head, own)))
    return tables


def _cells(row: TableRow, free: tuple[str, ...], paper: PaperRow | None) -> list[str]:
    """Values; errors as median (worst), with those of the paper; scatter, and number of seeds."""
    cells = [row.case.name, f"{row.case.noise:.2f}"]
    cells += [number(row.value(name), ".4f") for name in free]
    for name, short in (*zip(free, free, strict=True), ("pressure", "p")):
        cells += [_error(row, name), number(getattr(paper, f"error_{short}", None), ".2f")]
    cells += [_error(row, name) for name in FIELDS]
    cells.append("/".join(number(row.scatter(name), ".2f") for name in free))
    return [*cells, f"{len(row.ended)}{f' ({row.failed} diverged)' if row.failed else ''}"]


def _error(row: TableRow, name: str) -> str:
    median, worst = row.error(name)
    return "-" if median is None else f"{median:.2f} ({number(worst, '.2f')})"


def text(study: Study) -> str:
    """The tables for a terminal."""
    lines = []
    for title, _, table in tables_of(study):
        lines += ["", f"{title}, {study.config.recipe} recipe, {study.seeds} seeds"]
        lines += table.lines()
    return "\n".join([*lines, "", summary(study)])


def summary(study: Study) -> str:
    """The number of trainings, their time, and the failures."""
    members = sum(len(row.results) for row in study.rows)
    failed = sum(row.failed for row in study.rows)
    first = study.rows[0].results[0]
    training_s = sum(study.training_s.values())
    return (
        f"{members} trainings of {first.timing.steps} steps as {batches(len(study.levels))} on "
        f"{first.device}: {duration(training_s)} of training, {training_s / members:.1f} s each, "
        f"{duration(study.total_s)} in all"
        f"{f'; {failed} diverged' if failed else ''}"
    )


def write(study: Study, folder: Path) -> Path:
    """Write tables.csv, with a row of every training, and tables.html; the path of the page."""
    settings = flatten(dataclasses.replace(study.config, resume=False))  # as of an unbroken study
    page = template("tables.html").render(
        study=study,
        tables=tables_of(study),
        summary=summary(study),
        settings={name: str(value) for name, value in settings.items()},
        version=study.rows[0].results[0].versions.get("granpinn", ""),
    )
    rows = [
        {"case": row.case.name, "failure": result.failure, **cells_of(result)}
        for row in study.rows
        for result in row.results
    ]
    write_table(rows, folder / "tables.csv")
    write_text(folder / "tables.html", page)
    return folder / "tables.html"
