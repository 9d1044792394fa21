"""Grades of all identifications whose law is known, against the error of their mu(I).

python -m bench.studies.coverage.assessment

It reads results/rows.csv (table.py), gives every line the error bars and the assessment that a run
of today would have, and prints how many have each grade: by the rms error of mu(I) over the I of
the flow, for simulated flows and grains, and for controls, which obey another law or hang on walls;
and how often data of mu(I) are said to contradict it. Lines of earlier studies lack slips, momentum
balance or residuals; conditions on these do not hold there.

Defends: no control is good, at least 80 % of clean simulated collapses are, and at most 2 % of the
flows that obey mu(I) are said to contradict it, of simulations and of grains.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.studies.coverage.materials import LAW
from bench.studies.coverage.table import GRAINS, PATH, known_of
from granpinn.checks import momentum_balance
from granpinn.config import Config
from granpinn.inspection.momentum_balance import Baseline, Point
from granpinn.physics import terms
from granpinn.results import DataSummary, Input, Parameter, Parameters, Residuals, Result, Timing
from granpinn.results.record import Reason
from granpinn.results.records import IdentifiedLaw
from granpinn.uncertainty.determined import applied, determined, with_curve
from granpinn.uncertainty.error_bars import judge

ERRORS = {"below 2 %": 2.0, "2 to 10 %": 10.0, "above 10 %": np.inf}  # rms of mu(I), in %
PLACES = 20  # inertial numbers over which errors are averaged, evenly in log I
CLEAN = ("coverage", "varied")  # populations of clean collapses at the usual level
WORDS = ("population", "name", "law", "failure", "level", "symmetries", "slips", "carried")


def judged(cells: dict[str, str]) -> dict[str, Any]:
    """The assessment of a line of the table: of a simulated flow, of grains, or of a control."""
    n = {k: float(v) for k, v in cells.items() if k not in WORDS and v and " " not in v}
    real = cells["population"] == GRAINS
    result, error = result_of(cells, n), _error(cells, n)
    return {
        "clean": cells["population"] in CLEAN,
        "kind": cells["law"] if cells["law"] != LAW else GRAINS if real else "simulated",
        "error": next(name for name, end in ERRORS.items() if error <= end),
        "grade": result.assessment.grade,
        "contradicted": None
        if result.residuals is None
        else any(said.startswith("The data contradict") for said in result.assessment.reasons),
    }


def result_of(cells: dict[str, str], n: dict[str, float]) -> Result:
    """The records of a line as of a run of today.

    Args:
        n: the numbers among the cells.
    """
    known, members = known_of(cells)
    residuals = Residuals({name: n.get(name, 0.0) for name in ("noise", *terms.NAMES)})
    I_range = n["I_low"], n["I_high"]
    symmetries = tuple(filter(None, cells["symmetries"].split("; ")))
    config = Config(level=cells["level"])  # type: ignore[arg-type]
    mu_s, mu_2 = (Parameter(value, False) for value in known.mu)
    result = Result(
        parameters=Parameters(mu_s=mu_s, mu_2=mu_2, I0=Parameter(n["I0"], True)),
        level=config.level,
        form=config.form,
        recipe=config.recipe,
        seed=0,
        data=DataSummary(0, 0, 0.0, 0, symmetries, _slips(cells["slips"])),
        timing=Timing(0.0, int(n["steps"])),
        device="",
        versions={},
        input=Input(cells["name"], ""),
        law=IdentifiedLaw("mu_of_i", I_range),
        members=members,
        residuals=residuals,
    )
    found = judge(result, known, config)
    assert not isinstance(found, str)  # the default recipe has error bars
    result = replace(
        result,
        parameters=Parameters(**found.parameters, I0=result.parameters["I0"]),
        residuals=residuals if cells["momentum"] else None,
        covariance=found.covariance,
        error_bars=found.bars,
    )
    if cells["carried"] == "True":
        result = momentum_balance.without_error_bars(result)
    result = applied(result, determined(result, [I_range]))
    result = with_curve(result, I_range)
    points = tuple(momentum_balance.difference(p, result) for p in _points(cells["balance"]))
    balance = Baseline("walls carry the grains", carried=cells["carried"] == "True")
    record = momentum_balance.MomentumBalance(balance, points)
    return result.with_record("momentum_balance", record)


def _slips(text: str) -> tuple[Reason, ...]:
    return tuple(Reason(grade, "a slip") for grade in text.split())


def _points(text: str) -> list[Point]:
    numbers = np.reshape(list(map(float, text.split())), (-1, 3)).tolist()
    return [Point(at, mu, se, 0) for at, mu, se in numbers]


def _error(cells: dict[str, str], n: dict[str, float]) -> float:
    """The rms error of mu(I) in %, over the I of the flow where its law is known."""
    low, high = n["I_low"], n["I_high"]
    if cells["true_low"]:
        low, high = max(low, n["true_low"]), min(high, n["true_high"])
        if low > high:
            low = high = n["true_low"]
    x = np.geomspace(low, high, PLACES)
    x = x / (x + n["I0"])
    mu = [np.mean(list(map(float, cells[k].split()))) for k in ("mu_s", "mu_2")]
    true = n["true_s"], n["true_2"]
    of_law, of_truth = (a * (1 - x) + b * x for a, b in (mu, true))
    return float(100 * np.sqrt(np.mean((of_law / of_truth - 1) ** 2)))


def report(found: pd.DataFrame) -> str:
    """How many have each grade."""
    lines = []
    known = found.kind.isin(("simulated", GRAINS))
    for kind in ("simulated", GRAINS):
        own = found[found.kind == kind]
        lines.append(f"{kind}, by the rms error of mu(I)\n{pd.crosstab(own.error, own.grade)}")
        said = own.contradicted.dropna()
        lines.append(f"obey mu(I) and are said not to: {said.sum()} of {len(said)}")
    clean = found[known & found.clean]
    lines.append(f"good among clean collapses: {(clean.grade == 'good').sum()} of {len(clean)}")
    lines.append(f"controls\n{pd.crosstab(found.kind[~known], found.grade[~known])}")
    return "\n\n".join(lines)


def read(path: Path = PATH) -> pd.DataFrame:
    """The assessments of all lines that did not fail and hold grains that shear."""
    with path.open(encoding="utf-8", newline="") as file:
        lines = [c for c in csv.DictReader(file) if not c["failure"] and c["I_low"]]
    return pd.DataFrame(map(judged, lines))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--csv", type=Path, default=PATH, help="the table")
    print(report(read(parser.parse_args(arguments).csv)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
