"""Measured numbers of the documentation: each name with its raw result and how to compute it.

`FILES` has every raw result that the documentation uses. A result that moves changes this table
alone. numbers.py puts the values into the Markdown files.
"""

from __future__ import annotations

import csv
import json
import math
import re
import statistics
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from granpinn import checks
from granpinn.config import Config, flatten

ROOT = Path(__file__).parents[2]
STUDIES = "bench/studies"
FILES = {
    "flows": f"{STUDIES}/coverage/results/rows.csv",  # identifications of flows of known law
    "coverage": f"{STUDIES}/coverage/results/report.md",  # how often the intervals hold
    "references": f"{STUDIES}/identification/results/default_reference.json",
    "noisy references": f"{STUDIES}/noise/results/reference_files_all.json",
    "laws": f"{STUDIES}/laws/choice/results/present.json",
    "exact flows": f"{STUDIES}/floor/results/steps_15000.json",
    "scenes": f"{STUDIES}/grains/results/scenes.json",
    "simulator fit": f"{STUDIES}/simulator_fit/results/noise.json",
    "jets": "bench/results/jet_step.json",
    "command, CPU": "bench/results/command_full_epyc.json",
    "command, GPU": "bench/results/command_h100_15000.json",
    "demonstration": "docs/results/demonstration.txt",  # what the command of README.md prints
    "tests": "docs/results/tests.txt",  # the last lines of the second command of README.md
}

Law = tuple[float, float, float]  # mu_s, mu_2, I0
LAWS = ("mu_s", "mu_2", "true_s", "true_2", "I0", "I_low", "I_high", "true_low")
INERTIAL_NUMBERS = (0.01, 0.03, 0.055, 0.1, 0.185)  # those of them that a flow reaches
SCENES = {
    "chute_fast": "steep chute, from rest",
    "chute_slow": "gentle chute, from rest",
    "chute_fast_steady": "steep chute, steady",
    "channel_wall": "channel of spheres, through its side wall",
    "collapse_2": "collapse, aspect 2",
    "collapse_6": "collapse, aspect 6",
    "drum": "drum",
    "heap": "heap",
    "silo": "silo",
}
GRAINS = [scene for scene in SCENES if scene not in ("heap", "silo")]
# Populations of the report by their names, the first pattern that fits.
KINDS = {
    r"grains": "simulated grains",
    r"films": "collapses, through pictures and a PIV program",
    r".*V0": "collapses at level V0",
    r"steps_": "collapses, 1,000 to 10,000 steps",
    r"cells_1024": "collapses on 1,024 cells",
    r"noisy|varied_0": "collapses with noise of 0.5 to 30 %",
    r"": "collapses without noise",
}


def text(name: str) -> str:
    """A raw result."""
    return (ROOT / FILES[name]).read_text(encoding="utf-8")


@cache
def result(name: str) -> Any:
    """A raw result in JSON."""
    return json.loads(text(name))


@cache
def flows() -> list[dict[str, str]]:
    """Identifications of flows whose law is known, one row each."""
    return list(csv.DictReader(text("flows").splitlines()))


def friction(mu_s: float, mu_2: float, I0: float, inertia: float) -> float:
    """mu at an inertial number."""
    return mu_s + (mu_2 - mu_s) * inertia / (inertia + I0)


def law_errors(found: Law, true: Law) -> list[float]:
    """Errors of mu(I) in %, at all of `INERTIAL_NUMBERS`."""
    return [100 * (friction(*found, n) / friction(*true, n) - 1) for n in INERTIAL_NUMBERS]


def errors(row: dict[str, str]) -> list[float]:
    """Errors of mu(I) of an identification in %, at the ends of its range of I and between."""
    number = {key: float(row[key]) for key in LAWS if row[key]}
    ends = number["I_low"], number["I_high"]
    places = [ends[0], *(n for n in INERTIAL_NUMBERS if ends[0] < n < ends[1]), ends[1]]
    if row["true_low"] == row["true_high"] != "":  # mu is known at one I only
        places = [number["true_low"]]
    true, found = (
        [friction(number[f"{p}_s"], number[f"{p}_2"], number["I0"], place) for place in places]
        for p in ("true", "mu")
    )
    return [100 * (mu / right - 1) for mu, right in zip(found, true, strict=True)]


def grains(*scenes: str, friction_between: str = "") -> list[float]:
    """Errors of mu(I) in simulated grains, in %."""
    return [
        error
        for row in flows()
        if row["population"] == "grains"
        and row["name"].rpartition("-")[0] in scenes
        and row["name"].endswith(friction_between)
        for error in errors(row)
    ]


def grains_table() -> Iterator[str]:
    """Errors of mu(I) in every scene of grains."""
    yield "| flow | friction 0.2 | 0.4 | 0.7 |"
    yield "|---|---|---|---|"
    for scene, title in SCENES.items():
        cells = [grains(scene, friction_between=f"-{f}") for f in ("0.2", "0.4", "0.7")]
        yield f"| {title} | {' | '.join(span(c) if c else '' for c in cells)} |"


def references() -> list[float]:
    """Errors of mu(I) in collapses of another solver, in %."""
    truth = {row["name"]: of(row["truth"]) for row in result("references")["rows"]}
    return [
        error
        for member in result("references")["members"]
        for error in law_errors(of(member["parameters"]), truth[member["case"]])
    ]


def of(law: dict[str, float]) -> Law:
    """Parameters of mu(I)."""
    return law["mu_s"], law["mu_2"], law["I0"]


def references_table() -> Iterator[str]:
    """Median errors of collapses of another solver, the worst in brackets."""
    yield "| (mu_s, mu_2) | mu_s | mu_2 | velocity | p | p, flowing | p, at rest |"
    yield "|---|---|---|---|---|---|---|"
    for row in result("references")["rows"]:
        error = row["errors"]
        law = ", ".join(f"{row['truth'][name]:.2f}" for name in ("mu_s", "mu_2"))
        cells = [f"{error[k]['median']:.1f} ({error[k]['worst']:.1f})" for k in ("mu_s", "mu_2")]
        cells += [f"{error['velocity']['median']:.2f}"]
        fields = ("pressure", "pressure_flowing", "pressure_stagnant")
        cells += [f"{error[k]['median']:.1f}" for k in fields]
        yield f"| ({law}) | {' | '.join(cells)} |"


def noisy_references() -> list[float]:
    """The same with white noise of 20 % of the largest speed."""
    truth = {row["name"]: of(row["truth"]) for row in result("references")["rows"]}
    wrong = []
    for flow, _, _, _, of_s, of_2 in result("noisy references")["rows"]:
        mu_s, mu_2, I0 = truth[flow]
        found = mu_s * (1 + of_s / 100), mu_2 * (1 + of_2 / 100), I0
        wrong += law_errors(found, truth[flow])
    return wrong


def parameter_errors(population: str, name: str) -> list[float]:
    """Errors of mu_s ("s") or mu_2 ("2") of a population of simulated flows, in %."""
    return [
        100 * (float(row[f"mu_{name}"]) / float(row[f"true_{name}"]) - 1)
        for row in flows()
        if row["population"] == population and not row["failure"]
    ]


class Population(NamedTuple):
    """A population of the report; pairs are of mu_s and mu_2, or of both ends of the range of I.

    Attributes:
        flows: their number.
        held, ends: how many of the 90 % intervals hold, in %.
        score: as in the report.
        width: half-width in %.
    """

    name: str
    flows: int
    held: tuple[float, ...]
    ends: tuple[float, ...]
    score: tuple[float, ...]
    width: tuple[float, ...]


def populations() -> Iterator[Population]:
    """The populations that the fit of the error model has not seen, from its report."""
    for line in text("coverage").split("\n\n")[1].splitlines()[2:]:
        name, flows, *pairs = (cell.strip() for cell in line.strip("|").split("|"))
        yield Population(name, int(flows), *(tuple(map(float, p.split("/"))) for p in pairs))


def coverage_table() -> Iterator[str]:
    """How often 90 % intervals hold, by kinds of flows."""
    kinds: dict[str, list[Population]] = {kind: [] for kind in reversed(KINDS.values())}
    for population in populations():
        kind = next(kind for pattern, kind in KINDS.items() if re.match(pattern, population.name))
        kinds[kind].append(population)
    yield "| flows | number | mu_s held, % | mu_2 held, % | half-width of mu_s, mu_2, % |"
    yield "|---|---|---|---|---|"
    for kind, members in kinds.items():
        total = sum(p.flows for p in members)
        held_s, held_2, *widths = (
            sum(p.flows * (*p.held, *p.width)[k] for p in members) / total for k in range(4)
        )
        width = ", ".join(f"{w:.1f}" for w in widths)
        yield f"| {kind} | {total} | {held_s:.0f} | {held_2:.0f} | {width} |"


def held() -> list[float]:
    """Holds of mu_s and mu_2 in all populations of 40 flows or more."""
    return [held for p in populations() if p.flows >= 40 for held in p.held]


def laws_told() -> list[bool]:
    """For each flow of known law: is it the chosen law, or not told apart from it?"""
    told = []
    for row in result("laws")["rows"]:
        apart = {entry["law"]: entry["not_told_apart_from"] for entry in row["comparison"]}
        told.append(row["law"] in (row["chosen"], *apart.get(row["chosen"], ())))
    return told


def exact_flows(name: str) -> list[float]:
    """Errors of a parameter on flows that solve the equations exactly, in %."""
    return [row[f"{name}_percent"] for row in result("exact flows")["rows"] if not row["noise"]]


def balances() -> list[float]:
    """Errors of the momentum balance alone in simulated grains, in %."""
    rows = [scene.get("balance") or {} for scene in result("scenes")["scenes"]]
    return [error for row in rows for error in (row.get("error_percent") or {}).values()]


def simulator_fits(name: str) -> list[float]:
    """Rms errors of fits of the simulator on 512 cells, with noise of 20 %, in %."""
    rows = result("simulator fit")["rows"]
    fits = [row for row in rows if (row["cells"], row["noise"]) == (512, 0.2)]
    return [row["errors_percent"][name]["rmse"] for row in fits]


def reference_pressures(name: str) -> list[float]:
    """Errors of the pressure in collapses of another solver, in %."""
    return [member["error_percent"][name] for member in result("references")["members"]]


def jets_table() -> Iterator[str]:
    """Times of a step by derivatives of several kinds."""
    titles = {
        "fused": "fused jets",
        "fused, compiled": "fused jets, loss compiled by torch.compile",
        "nested": "nested automatic differentiation",
        "by hand": "Taylor jets written by hand in torch",
        "by hand, compiled": "the same, compiled by torch.compile",
    }
    yield from ("| derivatives by | ms |", "|---|---|")
    for name, title in titles.items():
        yield f"| {title} | {result('jets')['cpu_ms'][name]:.3g} |"


def studies() -> Iterator[str]:
    """The notes of all studies, each with its question."""
    yield from ("| study | question |", "|---|---|")
    for note in sorted((ROOT / STUDIES).glob("**/note.md")):
        title = note.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        question = title.rpartition(": ")[2]
        name = note.parent.name.replace("_", " ")
        link = note.relative_to(ROOT).as_posix()
        yield f"| [{name}](../../{link}) | {question[0].upper()}{question[1:]} |"


def layers() -> str:
    """The layers of imports in pyproject.toml, the highest first."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    rows = next(c["layers"] for c in contracts if c["type"] == "layers")
    rows = [row for row in rows if row != "__main__"]
    text = textwrap.fill(" > ".join(rows), 96, break_on_hyphens=False)
    return fenced(text)


def checks_table() -> Iterator[str]:
    """The checks of a fit, in the order in which they are made."""
    yield "| check | name | made | seconds, roughly |"
    yield "|---|---|---|---|"
    for check in checks.every():
        made = ["by default"] if check.quick else []
        made += [f"`--{check.flag.replace('_', '-')}`"] if check.flag else []
        title, seconds = check.record.title, f"{check.seconds:,.0f}"
        yield f"| {title} | `{check.name}` | {', '.join(made)} | {seconds} |"


def settings() -> dict[str, Callable[[], str]]:
    """Every default of a setting, as `setting.steps`."""
    return {
        f"setting.{key}": partial(format, value, "," if isinstance(value, int) else "")
        for key, value in flatten(Config()).items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def span(numbers: Iterable[float]) -> str:
    """The range of numbers, with signs: two digits."""
    ends = min(numbers := [*numbers]), max(numbers)
    words = [f"{x:+.0f}" if abs(x) >= 9.95 else f"{x:+.1f}" for x in ends]
    return " to ".join(dict.fromkeys(words))


def rms(numbers: Iterable[float]) -> str:
    """The root mean square."""
    return f"{math.sqrt(statistics.fmean(x * x for x in numbers)):.1f}"


def between(numbers: Iterable[float]) -> str:
    """The range of sizes."""
    ends = min(numbers := [*numbers]), max(numbers)
    return " to ".join(f"{x:.1f}" for x in ends)


def seconds(numbers: Iterable[float]) -> str:
    """The median of times."""
    return f"{statistics.median(numbers):.0f} s"


def size(numbers: Iterable[float]) -> str:
    """The median of the sizes."""
    return f"{statistics.median(map(abs, numbers)):.2g}"


def demonstration() -> str:
    """The first and the last lines of what the demonstration prints."""
    lines = text("demonstration").rstrip().splitlines()
    return fenced("\n".join([*lines[:4], "...", *lines[-2:]]))


def fenced(lines: str) -> str:
    """A block of text."""
    return f"```text\n{lines.rstrip()}\n```"


def table(lines: Callable[[], Iterable[str]]) -> Callable[[], str]:
    """The lines of a table as one text."""
    return lambda: "\n".join(lines())


NUMBERS: dict[str, Callable[[], str]] = {
    # Accuracy
    "references.mu": lambda: span(references()),
    "references.table": table(references_table),
    "references.seeds": lambda: f"{result('references')['seeds']}",
    "noise.mu": lambda: span(noisy_references()),
    "noise.rms": lambda: rms(noisy_references()),
    "noise.mu_2": lambda: size(row[5] for row in result("noisy references")["rows"]),
    "grains.mu": lambda: span(grains(*GRAINS)),
    "grains.rms": lambda: rms(grains(*GRAINS)),
    "grains.chutes": lambda: span(grains("chute_fast", "chute_slow")),
    "grains.steady": lambda: span(grains("chute_fast_steady")),
    "grains.heaps": lambda: span(grains("heap")),
    "grains.silos": lambda: span(grains("silo")),
    "grains.table": table(grains_table),
    "V0.mu_s": lambda: size(parameter_errors("coverage_V0", "s")),
    "V0.mu_2": lambda: size(parameter_errors("coverage_V0", "2")),
    "V1.mu_s": lambda: size(parameter_errors("coverage", "s")),
    "V1.mu_2": lambda: size(parameter_errors("coverage", "2")),
    "films.mu_s": lambda: rms(parameter_errors("films", "s")),
    "films.mu_2": lambda: rms(parameter_errors("films", "2")),
    "exact.mu_s": lambda: rms(exact_flows("mu_s")),
    "exact.mu_2": lambda: rms(exact_flows("mu_2")),
    "balance.mu": lambda: span(balances()),
    "laws.told": lambda: f"{sum(laws_told())} of {len(laws_told())}",
    "fit.mu_s": lambda: between(simulator_fits("mu_s")),
    "fit.mu_2": lambda: between(simulator_fits("mu_2")),
    "pressure.flowing": lambda: between(reference_pressures("pressure_flowing")),
    "pressure.resting": lambda: between(reference_pressures("pressure_stagnant")),
    "pressure.simulated": lambda: between(reference_pressures("pressure_simulated")),
    # Error bars
    "coverage.held": lambda: f"{min(held()):.0f} to {max(held()):.0f} %",
    "coverage.table": table(coverage_table),
    # Times and outputs
    "time.demonstration": lambda: seconds(result("command, CPU")["rows"][0]["seconds"]),
    "time.collapse": lambda: seconds(result("command, CPU")["rows"][1]["seconds"]),
    "time.GPU": lambda: seconds(run["seconds"]["exit_s"] for run in result("command, GPU")["runs"]),
    "demonstration": demonstration,
    "demonstration.assessment": lambda: fenced(text("demonstration").splitlines()[-1]),
    "tests": lambda: fenced(text("tests")),
    "jets.table": table(jets_table),
    "studies": table(studies),
    "layers": layers,
    "checks": table(checks_table),
    **settings(),
}
