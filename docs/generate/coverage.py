"""How often the intervals of the error model hold, from the report of its fit."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from docs.generate.raw import text
from granpinn.uncertainty import error_model

# Populations of the report by their names, the first pattern that fits.
KINDS = {
    r"grains": "simulated grains",
    r"films": "collapses, through pictures and a PIV program",
    r".*V0": "collapses at level V0",
    r"steps_": "collapses, 1,000 to 10,000 steps",
    r"chutes_noisy": "steep chutes with noise of 0.5 to 30 %",
    r"chutes": "steep chutes without noise",
    r"cells_1024": "collapses on 1,024 cells",
    r"noisy|varied_0": "collapses with noise of 0.5 to 30 %",
    r"": "collapses without noise",
}


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


def spread(numbers: Iterable[float]) -> str:
    """The range of numbers without signs."""
    ends = min(numbers := [*numbers]), max(numbers)
    return " to ".join(f"{x:.0f}" for x in ends)


def others(field: str, steps: bool = False) -> list[float]:
    """A field in all populations of 40 flows or more, of other numbers of steps or not."""
    large = [p for p in populations() if p.flows >= 40 and p.name.startswith("steps_") == steps]
    return [value for p in large for value in getattr(p, field)]


NUMBERS: dict[str, Callable[[], str]] = {
    "coverage.held": lambda: f"{spread([*others('held'), *others('held', steps=True)])} %",
    "coverage.table": lambda: "\n".join(coverage_table()),
    "coverage.ends": lambda: f"{spread(others('ends'))} %",
    "coverage.parameters": lambda: f"{spread(others('held'))} %",
    "coverage.steps": lambda: f"{spread(others('held', steps=True))} %",
    "coverage.level": lambda: f"{100 * error_model.load().level:.1f} %",
    "coverage.tilt": lambda: f"{100 * error_model.load().tilt:.1f} %",
}
