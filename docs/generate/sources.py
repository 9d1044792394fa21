"""Measured numbers of the documentation: each name with its raw result and how to compute it.

raw.py reads the raw results, numbers.py puts the values into the Markdown files.
"""

from __future__ import annotations

import json
import math
import statistics
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from docs.generate import coverage, gallery
from docs.generate.raw import ROOT, STUDIES, rows, text
from granpinn.config import Config, flatten
from granpinn.results.record import FIT, every

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
    "drum": "drum, mean over time",
    "drum_filmed": "drum, as filmed",
    "heap": "heap",
    "silo": "silo",
}
GRAINS = [scene for scene in SCENES if scene not in ("heap", "silo")]


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
    if row["true_low"]:  # what grains obey was measured between two I only
        true_low, true_high = float(row["true_low"]), float(row["true_high"])
        ends = max(ends[0], true_low), min(ends[1], true_high)
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
        for row in rows("flows")
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


def references(noise: str = "clean") -> list[dict[str, str]]:
    """Identifications of collapses of another solver by the default recipe, one row each seed."""
    trained = (row for row in rows("rules") if row["variant"] == "default")
    return [row for row in trained if row["group"] == f"{noise} (file)"]


def law_of(row: dict[str, str]) -> tuple[float, float]:
    """mu_s and mu_2 of a collapse of another solver, from its name."""
    mu_s, mu_2 = map(float, row["flow"].split("_")[1:])
    return mu_s, mu_2


def reference_laws(noise: str = "clean") -> list[float]:
    """Errors of mu(I) in collapses of another solver, in %; I0 is 0.3."""
    errors = []
    for row in references(noise):
        mu_s, mu_2 = law_of(row)
        s, two = (1 + float(row[name]) / 100 for name in ("mu_s", "mu_2"))
        errors += law_errors((s * mu_s, two * mu_2, 0.3), (mu_s, mu_2, 0.3))
    return errors


def references_table() -> Iterator[str]:
    """Median errors of collapses of another solver, the worst in brackets."""
    yield "| (mu_s, mu_2) | mu_s | mu_2 | velocity | p | p, flowing | p, at rest |"
    yield "|---|---|---|---|---|---|---|"
    for mu_s, mu_2 in dict.fromkeys(map(law_of, references())):
        seeds = [row for row in references() if law_of(row) == (mu_s, mu_2)]
        parameters = [[abs(float(row[name])) for row in seeds] for name in ("mu_s", "mu_2")]
        cells = [f"{statistics.median(c):.1f} ({max(c):.1f})" for c in parameters]
        own = [row for row in reference_fields() if row["mu_s mu_2"] == f"{mu_s:.2f} {mu_2:.2f}"]
        for name in ("velocity", "pressure", "pressure_flowing", "pressure_at_rest"):
            error = statistics.median(abs(float(row[f"{name}_percent"])) for row in own)
            cells += [f"{error:.2f}" if name == "velocity" else f"{error:.1f}"]
        yield f"| ({mu_s:.2f}, {mu_2:.2f}) | {' | '.join(cells)} |"


def reference_fields() -> list[dict[str, str]]:
    """Errors of the fields of the same collapses, one row each seed."""
    return [row for row in rows("references") if row["flows"] == "reference, default"]


def parameter_errors(population: str, name: str) -> list[float]:
    """Errors of mu_s ("s") or mu_2 ("2") of a population of simulated flows, in %."""
    return [
        100 * (float(row[f"mu_{name}"]) / float(row[f"true_{name}"]) - 1)
        for row in rows("flows")
        if row["population"] == population and not row["failure"]
    ]


def laws_told() -> list[bool]:
    """For each flow of known law: is it the chosen law, or not told apart from it?"""
    present = (row for row in rows("laws") if row["population"] == "present")
    return [row["true law not told apart"] == "True" for row in present]


def exact_flows(name: str) -> list[float]:
    """Errors of a parameter on flows that solve the equations exactly, in %."""
    default = (row for row in rows("exact flows") if row["run"] == "steps_15000")
    return [float(row[f"{name}_percent"]) for row in default]


def balances() -> list[float]:
    """Errors of the momentum balance alone in simulated grains, in %, at several I of a scene."""
    errors = []
    for line in text("scenes").splitlines()[2:]:
        cells = [cell.strip() for cell in line.strip("| ").split("|")]
        if "mean" not in cells[8]:
            errors += [float(word) for word in cells[8].split() if word[0] in "+-" and word[1:]]
    return errors


def reference_pressures(name: str) -> list[float]:
    """Errors of the pressure in collapses of another solver, in %."""
    return [float(row[f"{name}_percent"]) for row in reference_fields()]


def windows(spacings: int, averaged: bool, end: int = -1) -> list[float]:
    """Errors of mu at an end of the range of I by the width of the windows, in %, for each law."""
    key = (spacings, averaged)
    found = json.loads(text("windows"))["rows"]
    return [r["errors"][end] for r in found if (r["spacings"], r["averaged"]) == key]


def in_bands() -> str:
    """How often the true mu lies in its 90 % band, with averages over four spacings."""
    inside = []
    for row in json.loads(text("windows"))["rows"]:
        for error, (low, high) in zip(row["errors"], row.get("band", []), strict=False):
            true = math.sqrt(low * high) / (1 + error / 100)  # the band is symmetric in log mu
            inside += [low <= true <= high] if row["averaged"] else []
    return f"{sum(inside)} of {len(inside)}"


def windows_table() -> Iterator[str]:
    """Errors of mu at both ends of the range of I by the width of the windows, in %."""
    yield "| window / spacing | smallest I | largest I | averaged: smallest I | largest I |"
    yield "|---|---|---|---|---|"
    for width in sorted({row["spacings"] for row in json.loads(text("windows"))["rows"]}):
        cells = []
        for averaged in (False, True):
            for end in (0, -1):
                errors = windows(width, averaged, end)
                cells.append(", ".join(f"{error:+.1f}" for error in errors))
        yield f"| {width} | {' | '.join(cells)} |"


def tried(good: bool) -> list[dict[str, str]]:
    """Cases of contradictions and traps, or good files."""
    return [row for row in rows("contradictions") if row["case"].startswith("good: ") == good]


def right(cases: Iterable[dict[str, str]]) -> str:
    """How many cases are right."""
    answers = [row["right"] == "right" for row in cases]
    return f"{sum(answers)} of {len(answers)}"


def exits(run: str, steps: str) -> list[float]:
    """Times of a whole command in s."""
    timed = {
        (row["run"], row["exit_s"])
        for row in rows("commands")
        if row["run"].startswith(run) and row["steps"] == steps
    }
    return [float(exit_s) for _, exit_s in timed]


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
        yield f"| {title} | {json.loads(text('jets'))['cpu_ms'][name]:.3g} |"


def studies() -> Iterator[str]:
    """The questions of all studies, each with a link to its note."""
    for note in sorted((ROOT / STUDIES).glob("**/note.md")):
        question = note.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
        yield f"- [{question}](../../{note.relative_to(ROOT).as_posix()})"


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
    for check in every(FIT):
        made = ["by default"] if check.quick else []
        made += [f"`--{check.flag.replace('_', '-')}`"] if check.flag else []
        made = made or [f"`--checks {check.name}`"]
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


def fenced(lines: str) -> str:
    """A block of text."""
    return f"```text\n{lines.rstrip()}\n```"


def table(lines: Callable[[], Iterable[str]]) -> Callable[[], str]:
    """The lines of a table as one text."""
    return lambda: "\n".join(lines())


NUMBERS: dict[str, Callable[[], str]] = {
    # Accuracy
    "references.mu": lambda: span(reference_laws()),
    "references.table": table(references_table),
    "references.seeds": lambda: f"{len({row['seed'] for row in references()})}",
    "references.rms": lambda: rms(float(row["rms"]) for row in references()),
    "noise.mu": lambda: span(reference_laws("noise 20 %")),
    "noise.rms": lambda: rms(float(row["rms"]) for row in references("noise 20 %")),
    "noise.mu_2": lambda: size(float(row["mu_2"]) for row in references("noise 20 %")),
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
    "pressure.flowing": lambda: between(reference_pressures("pressure_flowing")),
    "pressure.resting": lambda: between(reference_pressures("pressure_at_rest")),
    # Error bars
    **coverage.NUMBERS,
    # Contradictions, windows, tracks
    "tracks.mu": lambda: span(json.loads(text("tracks"))["errors"]),
    "tracks.surface": lambda: f"{json.loads(text('tracks'))['surface_d']:+.1f}",
    "windows.points": lambda: span(windows(0, averaged=False)),
    "windows.four_points": lambda: span(windows(4, averaged=False)),
    "windows.four_averaged": lambda: span(windows(4, averaged=True)),
    "windows.in_bands": in_bands,
    "windows.table": table(windows_table),
    "contradictions.right": lambda: right(tried(good=False)),
    "contradictions.good": lambda: right(tried(good=True)),
    # Times and outputs
    "time.demonstration": lambda: seconds(exits("two EPYC cores", "6000")),
    "time.collapse": lambda: seconds(exits("two EPYC cores", "15000")),
    "time.GPU": lambda: seconds(exits("H100, 15000 steps", "15000")),
    "demonstration": lambda: fenced(text("demonstration")),
    "gallery": gallery.page,
    "demonstration.grade": lambda: fenced(text("demonstration").splitlines()[-2]),
    "tests": lambda: fenced(text("tests")),
    "jets.table": table(jets_table),
    "studies": table(studies),
    "layers": layers,
    "checks": table(checks_table),
    **settings(),
}
