"""One table of all populations: a line for each identification, with what cannot be made again.

python -m bench.studies.coverage.table RESULTS/*.json GRAINS/grains.json

The files are those of run.py and films.py, whose names are those of the populations, and those of
bench.studies.grains.run, which are the population `grains`. Lines of other populations stay. The
table is results/rows.csv, or the file of `--csv`. Values of the members of an ensemble stand in one
cell; so do the grades of slips, and I, mu and standard error of every point of the momentum
balance. The truth holds over the whole range of I of a simulated flow, and between `true_low` and
`true_high` for grains; a scene of one inertial number has one mu.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.studies.coverage.materials import LAW
from granpinn.results.records import Members
from granpinn.uncertainty.error_bars import center
from granpinn.uncertainty.error_model import Known, Pair, ends_of

PATH = Path(__file__).with_name("results") / "rows.csv"
GRAINS = "grains"
RESIDUALS = ("velocity", "noise", "momentum", "constitutive", "continuity")
COLUMNS = (
    *("population", "name", "law", "failure", "level", "steps"),
    *("mu_s", "mu_2", "I0", "I_low", "I_high"),
    *("true_s", "true_2", "true_low", "true_high"),
    *RESIDUALS,
    *("measured_noise", "independent"),
    *("symmetries", "slips", "carried", "balance"),
)
# Words of the names of populations that are left out together; else those of one draw of flows, and
# each number of steps.
ALIKE, STEPS = ("films", "512", "1024", "members"), "steps"

Cells = dict[str, Any]


class Row(NamedTuple):
    """One identification of a flow that obeys mu(I), or of grains.

    Attributes:
        family: of the populations that are left out together.
        truth: mu_s and mu_2.
        true_range: the range of I over which it holds; None: that of the flow.
    """

    population: str
    name: str
    family: str
    known: Known
    members: Members
    truth: Pair
    I0: float
    true_range: Pair | None


def simulated(population: str, row: dict[str, Any]) -> Cells:
    """The cells of a row of run.py or films.py."""
    flow, truth, range_ = row["flow"], row["truth"], row["I_range"] or (None, None)
    return {
        **_of_run(row),
        "population": population,
        "name": row["name"],
        "law": row["law"],
        "I0": flow["I0"],
        "I_low": range_[0],
        "I_high": range_[1],
        "true_s": truth["mu_s"],
        "true_2": truth["mu_2"],
    }


def of_grains(score: dict[str, Any]) -> Cells:
    """The cells of a score of bench.studies.grains; grains that walls carry have another law."""
    law, own, mean, range_ = (score[k] for k in ("law", "own_law", "mean", "result_I_range"))
    truth = own or {"mu_s": mean["mu"], "mu_2": mean["mu"]}
    low, high = score["I_range"] if own else (mean["I"], mean["I"])
    carried = score["baseline"] and score["baseline"]["carried"]
    return {
        **_of_run(score),
        "population": GRAINS,
        "name": f"{score['scene']}-{score['material']:g}",
        "law": "carried" if carried else LAW,
        "I0": law["I0"],
        "I_low": range_[0],
        "I_high": range_[1],
        "true_s": truth["mu_s"],
        "true_2": truth["mu_2"],
        "true_low": low,
        "true_high": high,
    }


def _of_run(row: dict[str, Any]) -> Cells:
    members, data, residuals = row["members"], row["data"], row["residuals"] or {}
    balance = row["baseline"] or {"carried": None, "points": []}
    return {
        "failure": row["failure"],
        "level": row["level"],
        "steps": row["steps"],
        **{name: " ".join(f"{v:.7g}" for v in members[name]) for name in ("mu_s", "mu_2")},
        **{name: residuals.get(name) for name in RESIDUALS},
        **{name: data[name] for name in ("measured_noise", "independent")},
        "symmetries": "; ".join(data["symmetries"]),
        "slips": " ".join(slip["grade"] for slip in data["slips"]),
        "carried": balance["carried"],
        "balance": " ".join(f"{v:.6g}" for point in balance["points"] for v in point[:3]),
    }


def read(path: Path = PATH) -> list[Row]:
    """The identifications of flows of mu(I) and of grains that did not fail."""
    with path.open(encoding="utf-8", newline="") as file:
        return [_row(cells) for cells in csv.DictReader(file) if _counts(cells)]


def _counts(cells: dict[str, str]) -> bool:
    return not cells["failure"] and cells["law"] == LAW and bool(cells["I_low"])


def known_of(cells: dict[str, str]) -> tuple[Known, Members]:
    """What the error model knows of a line, and its members."""
    values = {k: tuple(map(float, cells[k].split())) for k in ("mu_s", "mu_2")}
    members = Members(tuple(range(len(values["mu_s"]))), values)
    mu_s, mu_2 = center(members)
    known = Known(
        ends_of((float(cells["I_low"]), float(cells["I_high"])), float(cells["I0"])),
        (mu_s, mu_2),
        float(cells["velocity"]),
        float(cells["constitutive"]),
        float(cells["noise"]) or float(cells["measured_noise"] or 0),
        float(cells["independent"]),
        int(cells["steps"]),
        outline=cells["level"] == "V0",
        real=cells["population"] == GRAINS,
    )
    return known, members


def _row(cells: dict[str, str]) -> Row:
    population, name = cells["population"], cells["name"]
    known, members = known_of(cells)
    family = next((word for word in ALIKE if word in population), name.rpartition("-")[0])
    if STEPS in population:
        family = population
    truth = float(cells["true_s"]), float(cells["true_2"])
    end = cells["true_low"]
    limits = (float(end), float(cells["true_high"])) if end else None
    return Row(population, name, family, known, members, truth, float(cells["I0"]), limits)


def write(lines: Iterable[Cells], path: Path = PATH) -> None:
    """The table of these lines, with six digits."""
    with path.open("w", encoding="utf-8", newline="") as file:
        made = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        made.writeheader()
        for line in lines:
            made.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in line.items()})


def lines_of(path: Path) -> list[Cells]:
    """The lines of a file of raw results."""
    content = json.loads(path.read_text(encoding="utf-8"))
    if "scores" in content:
        return [of_grains(score) for score in content["scores"] if score["level"] == "V1"]
    return [simulated(path.stem, row) for row in content["rows"]]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("results", nargs="+", type=Path, help="files of run.py and the like")
    parser.add_argument("--csv", type=Path, default=PATH, help="the table")
    own = parser.parse_args(arguments)
    new = [line for path in own.results for line in lines_of(path)]
    old: list[Cells] = []
    if own.csv.exists():
        with own.csv.open(encoding="utf-8", newline="") as file:
            old = list(csv.DictReader(file))
    made = {line["population"] for line in new}
    write([*(line for line in old if line["population"] not in made), *new], own.csv)
    counts = {p: sum(line["population"] == p for line in new) for p in sorted(made)}
    print(", ".join(f"{population}: {n}" for population, n in counts.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
