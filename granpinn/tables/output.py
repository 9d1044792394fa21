"""The tables as text, HTML, JSON and CSV."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from granpinn.config import flatten
from granpinn.output import write_text
from granpinn.output.table import Table
from granpinn.report.page import duration, template
from granpinn.results import number, plain
from granpinn.results.parameters import PRESSURES, SIMULATED
from granpinn.results.results_file import write_table
from granpinn.tables.paper import SOURCE_1, SOURCE_2, VELOCITY_ALONE, PaperRow
from granpinn.tables.rows import TableRow
from granpinn.tables.study import Study, batches

FORMAT_NAME = "granpinn-tables"
FORMAT_VERSION = 1
FIELDS = (*PRESSURES, "velocity", *SIMULATED)
IN_TEXT = {
    "pressure_flowing": "flowing",
    "pressure_stagnant": "at rest",
    "pressure_simulated": "simulated",
}


class PaperTable(NamedTuple):
    """Rows, beside the rows of the paper if it has them."""

    title: str
    source: str
    rows: list[tuple[TableRow, PaperRow | None]]


def tables_of(rows: Sequence[TableRow]) -> list[PaperTable]:
    """For each level of information, table 1: flows without noise; table 2: flows with noise, and
    the same flows without noise if they were trained.
    """
    clean = [(row, row.paper_1) for row in rows if row.noise == 0]
    with_noise = {row.name for row in rows if row.noise > 0}
    noisy = [(row, row.paper_2) for row in rows if row.name in with_noise]
    noisy.sort(key=lambda pair: (pair[0].name, pair[0].noise))
    tables = []
    for title, source, found in (
        ("Table 1: identification without noise", SOURCE_1, clean),
        ("Table 2: identification with noise", SOURCE_2, noisy),
    ):
        for level in sorted({row.level for row, _ in found}):
            own = [pair for pair in found if pair[0].level == level]
            note = f"{source}; {VELOCITY_ALONE}" if level == "V0" else source
            tables.append(PaperTable(f"{title}, level {level}", note, own))
    return tables


def case_name(row: TableRow) -> str:
    """The true parameters, such as (0.40, 0.64), where all are known; else the file's name."""
    true = [getattr(row.truth, name, None) for name in row.values]
    known = [f"{value:.2f}" for value in true if value is not None]
    return f"({', '.join(known)})" if len(known) == len(true) else row.name


def text(study: Study) -> str:
    """The tables for a terminal: median (worst) of the errors in %, the paper's beside them."""
    lines = []
    for table in tables_of(study.rows):
        lines += ["", f"{table.title}, {study.config.recipe} recipe, {study.seeds} seeds"]
        head = ["case", "noise", *study.law.free]
        for name in (*study.law.free, "eps_p"):
            head += [f"{name} %", "paper"]
        head += [*IN_TEXT.values(), "scatter %"]
        lines += Table(head, [_cells(row, paper) for row, paper in table.rows]).lines()
    return "\n".join([*lines, "", summary(study)])


def summary(study: Study) -> str:
    """The number of trainings, their time, and the failures."""
    members = sum(len(group) for group in study.results)
    failed = sum(row.failed for row in study.rows)
    first = study.results[0][0]
    training_s = sum(study.training_s.values())
    return (
        f"{members} trainings of {first.timing.steps} steps as {batches(len(study.levels))} on "
        f"{first.device}: {duration(training_s)} of training, {training_s / members:.1f} s each, "
        f"{duration(study.total_s)} in all"
        f"{f'; {failed} diverged' if failed else ''}"
    )


def _cells(row: TableRow, paper: PaperRow | None) -> list[str]:
    cells = [case_name(row), f"{row.noise:.2f}"]
    cells += [number(value, ".4f") for value in row.values.values()]
    for name in (*row.values, "pressure"):
        own = row.errors[name]
        cells.append(f"{number(own.median, '.2f')} ({number(own.worst, '.2f')})")
        cells.append(number(paper_error(paper, name), ".2f"))
    cells += [number(row.errors[name].median, ".2f") for name in IN_TEXT]
    scatter = [number(row.errors[name].scatter, ".2f") for name in row.values]
    return [*cells, "/".join(scatter) + (f", {row.failed} diverged" if row.failed else "")]


def paper_error(paper: PaperRow | None, name: str) -> float | None:
    """The error in % in the paper for a parameter, or for "pressure"."""
    short = "p" if name == "pressure" else name
    found: float | None = getattr(paper, f"error_{short}", None)
    return found


def content(study: Study) -> dict[str, Any]:
    """Everything as JSON values."""
    members = [
        {
            "case": row.name,
            "noise": row.noise,
            "level": row.level,
            "seed": r.seed,
            "parameters": {name: p.value for name, p in r.parameters.items()},
            "interval_90": {n: p.interval_90 for n, p in r.parameters.items() if not p.fixed},
            "error_percent": r.error_percent,
            "loss": None if r.loss is None else dataclasses.asdict(r.loss),
            "failure": r.failure,
        }
        for row, group in zip(study.rows, study.results, strict=True)
        for r in group
    ]
    first = study.results[0][0]
    values: dict[str, Any] = plain(
        {
            "format_name": FORMAT_NAME,
            "format_version": FORMAT_VERSION,
            "levels": study.levels,
            "law": {"name": study.law.name},
            "recipe": study.config.recipe,
            "seeds": study.seeds,
            "device": first.device,
            "versions": first.versions,
            "steps": first.timing.steps,
            "training_s": study.training_s,
            "mean_training_s": sum(study.training_s.values()) / len(members),
            "total_s": study.total_s,
            "settings": _settings(study),
            "sources": {"paper_1": SOURCE_1, "paper_2": SOURCE_2},
            "rows": [_row_content(row) for row in study.rows],
            "members": members,
        }
    )
    return values


def _settings(study: Study) -> dict[str, Any]:
    """The settings; those of a study that was continued are the same as of one that was not."""
    return flatten(dataclasses.replace(study.config, resume=False))


def _row_content(row: TableRow) -> dict[str, Any]:
    papers = {"paper_1": row.paper_1, "paper_2": row.paper_2}
    content = dataclasses.asdict(row)
    content |= content.pop("fixed") | content.pop("values")
    return content | {
        name: None if paper is None else paper._asdict() for name, paper in papers.items()
    }


def csv_rows(study: Study) -> list[dict[str, Any]]:
    """A row for each case and table: every error with median, worst and scatter."""
    statistics = ("median", "worst", "scatter", "rmse", "bias", "signed_median")
    free = study.law.free
    rows = []
    for table in tables_of(study.rows):
        for row, paper in table.rows:
            cells: dict[str, Any] = {"table": table.title.partition(":")[0], "case": row.name}
            cells |= {name: getattr(row, name) for name in ("noise", "level")}
            cells |= {f"true_{name}": getattr(row.truth, name, None) for name in free}
            cells |= row.fixed | {n: getattr(row, n) for n in ("n_points", "members", "failed")}
            cells |= row.values
            for name in (*free, *FIELDS):
                cells |= {f"{name}_{what}": getattr(row.errors[name], what) for what in statistics}
            known = paper or (None,) * len(PaperRow._fields)
            rows.append(
                cells | {f"paper_{n}": v for n, v in zip(PaperRow._fields, known, strict=True)}
            )
    return rows


def html(study: Study) -> str:
    """The page, which needs no other file."""
    settings = {name: str(value) for name, value in _settings(study).items()}
    return template("tables.html", case_name=case_name).render(
        study=study,
        tables=tables_of(study.rows),
        paper_error=paper_error,
        summary=summary(study),
        settings=settings,
        version=study.results[0][0].versions.get("granpinn", ""),
    )


def write(study: Study, folder: Path) -> Path:
    """Write tables.json, tables.csv and tables.html; the path of the page."""
    text = json.dumps(content(study), indent=1, allow_nan=False) + "\n"
    write_text(folder / "tables.json", text)
    write_table(csv_rows(study), folder / "tables.csv")
    write_text(folder / "tables.html", html(study))
    return folder / "tables.html"
