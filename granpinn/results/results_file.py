"""The file results.json: strict JSON, written whole, and validated when it is read.

results.csv: one run as one row, for spreadsheets and for tables of many runs.

Every value has its unit in a column of its own ("1": dimensionless, "%", "s").  An empty cell is an
unknown value; a fixed parameter has neither standard deviation nor interval.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from pathlib import Path
from typing import Any

from granpinn.declared import checked
from granpinn.errors import BadInput
from granpinn.output import write_text
from granpinn.results.decoding import decode, plain, read_json
from granpinn.results.parameters import FIELD_ERRORS, NOT_DETERMINED
from granpinn.results.record import record_type
from granpinn.results.result import FORMAT_NAME, FORMAT_VERSION, Result


class ResultsFileError(BadInput):
    """results.json is missing, is not JSON, or breaks a rule of the format."""


def write_results(result: Result, path: str | Path) -> None:
    """Write results.json.  The result is decoded first, so that the file can be read back."""
    content = result.to_dict()
    from_dict(content)
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


@checked
def read_results(path: str | Path) -> Result:
    """Read and validate results.json; the message of ResultsFileError is one sentence."""
    path = Path(path)
    try:
        content = read_json(path)
    except FileNotFoundError:
        raise ResultsFileError(
            f"{path} does not exist: give the folder of a finished run of granpinn.train"
        ) from None
    except ValueError as error:
        raise ResultsFileError(f"{path} could not be read as strict JSON: {error}") from None
    return from_dict(content, path.name)


def from_dict(content: Any, where: str = "the result") -> Result:
    """The inverse of `Result.to_dict`; the message of ResultsFileError is one sentence."""
    if not isinstance(content, dict):
        raise ResultsFileError(f"{where} must hold an object, got {type(content).__name__}")
    content = dict(content)
    found = (content.pop("format_name", None), content.pop("format_version", None))
    content.pop("assessment", None)  # follows from the other records
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ResultsFileError(
            f"{where} must have format_name {FORMAT_NAME!r} and format_version {FORMAT_VERSION}, "
            f"got {found[0]!r} and {found[1]!r}: read it with the granpinn that wrote it"
        )
    try:
        checks = content.pop("checks", {})
        if not isinstance(checks, dict):
            raise ValueError(f"checks must be an object, got {checks!r}")
        records = {k: decode(record_type(k), v, f"checks.{k}") for k, v in checks.items()}
        return dataclasses.replace(decode(Result, content), checks=records)
    except ValueError as error:
        raise ResultsFileError(f"{where}: {error}") from None


FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of a cell that a spreadsheet computes
PLACES = {"low": 0.0, "middle": 0.5, "high": 1.0}  # of the range of log I
Cell = str | int | float | bool | None


def row(result: Result) -> dict[str, Cell]:
    """Column -> value, in the order of the file."""
    cells: dict[str, Cell] = {
        "input": result.input.name,
        "sha256": result.input.sha256,
        "level": result.level,
        "form": result.form,
        "law": result.law.name,
        "recipe": result.recipe,
        "seed": result.seed,
        "stopped": result.stopped,
        "assessment": result.assessment.grade,
        "reason": next(iter(result.assessment.reasons), None),
    }
    for name, parameter in result.parameters.items():
        low, high = (parameter.determined and parameter.interval_90) or (None, None)
        cells |= {
            name: parameter.value if parameter.determined else NOT_DETERMINED,
            f"{name}_std": parameter.std,
            f"{name}_low_90": low,
            f"{name}_high_90": high,
            f"{name}_unit": "1",
            f"{name}_fixed": parameter.fixed,
            f"{name}_true": getattr(result.truth, name, None),
        }
    for name in (*result.friction_law.free, *FIELD_ERRORS):
        cells[f"error_{name}"] = result.error_percent.get(name)
    cells["error_unit"] = "%"
    found = result.checks.get("momentum_balance")
    mean = found.balance.mean if found and found.balance.shown else None
    nearest = [d.percent for d in found.differences if mean and d.I == mean.I] if found else []
    cells |= {
        "I_unit": "1",
        "balance_I": mean.I if mean else None,
        "balance_mu": mean.mu if mean else None,
        "balance_mu_std": mean.se if mean else None,
        "balance_difference": nearest[0] if nearest else None,
        "balance_difference_unit": "%",
        "n_points": result.data.n_points,
        "n_frames": result.data.n_frames,
        "noise": result.data.noise,
        "steps": result.timing.steps,
        "wall": result.timing.wall_s,
        "wall_unit": "s",
        "granpinn": result.versions.get("granpinn"),
    }
    return {name: plain(value) for name, value in (cells | _curve(result)).items()}


def _curve(result: Result) -> dict[str, Cell]:
    """mu with its 90 % band at both ends and in the middle of the range of log I."""
    law, cells = result.law, dict[str, Cell]()
    curve, lost = law.curve, NOT_DETERMINED if law.I_range else None
    for place, share in PLACES.items():
        k = round(share * (len(curve.I) - 1)) if curve else 0
        cells |= {
            f"I_{place}": curve.I[k] if curve else None,
            f"mu_at_I_{place}": curve.mu[k] if curve else lost,
            f"mu_at_I_{place}_low_90": curve.low[k] if curve and curve.low else None,
            f"mu_at_I_{place}_high_90": curve.high[k] if curve and curve.high else None,
        }
    return cells


def write_csv(result: Result, path: str | Path) -> None:
    """Write results.csv: a header and one row; numbers with all their digits.

    A text that a spreadsheet would take for a formula gets an apostrophe before it.
    """
    cells, table = row(result), io.StringIO(newline="")
    csv.writer(table).writerows([cells.keys(), map(_plain_cell, cells.values())])
    write_text(path, table.getvalue())


def _plain_cell(cell: Cell) -> Cell:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
