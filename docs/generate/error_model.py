"""The numbers of the error model, from granpinn/uncertainty/error_model.json, and how often its
intervals hold, from the report of its fit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from granpinn.uncertainty import error_model

MODEL = "<!-- generated: error model -->"
COVERAGE = "<!-- generated: coverage -->"
REPORT = Path("bench") / "studies" / "coverage" / "results" / "report.md"
# What an effect of 1 means, by coefficient.
MEANINGS = {
    "constant": "logarithm of s of a clean flow that reaches I = I0/3",
    "outline": "no line of the free surface (level V0), as far as noise does not prevail",
    "noise": "noise of the vectors: noise over the rms velocity, times sqrt(1,000 / independent "
    "vectors), over mu",
    "misfit": "misfit of the velocity beyond its noise, over the rms velocity",
    "law": "residual of the friction law",
    "steps": "15,000 over the steps of the training",
    "reach": "largest I/(I + I0) of the data, over 0.25",
    "contrast": "mu at the largest over mu at the smallest I, over 1.3",
}


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Puts the tables in the places of their marks."""
    if MODEL in markdown:
        markdown = markdown.replace(MODEL, "\n".join(lines()))
        markdown = markdown.replace(COVERAGE, "\n".join(coverage()))
    return markdown


def lines() -> Iterator[str]:
    """A table of the coefficients, and the other numbers."""
    model = error_model.load()
    yield from (
        "| coefficient | lower end | upper end | tested | of the logarithm of |",
        "|" + "---|" * 5,
    )
    for name in error_model.COEFFICIENTS:
        knees = error_model.KNEES.get(name)
        above = f", above {knees[0]:g} / {knees[1]:g}" if knees else ""
        low, high = model.tested.get(name, (None, None))
        tested = "" if low is None else f"{low:.2g} to {high:.2g}"
        cells = name, f"{model.lower[name]:.2f}", f"{model.upper[name]:.2f}", tested
        yield f"| {' | '.join(cells)} | {MEANINGS[name]}{above} |"
    yield ""
    yield (
        f"Correlation of both ends: {model.correlation:.2f}. Degrees of freedom: "
        f"{model.freedom:g}. Real grains: level {100 * model.level:.1f} %, tilt "
        f"{100 * model.tilt:.1f} %. A free curve: {model.free_curve:g} times the errors of mu(I)."
    )


def coverage() -> Iterator[str]:
    """The first table of the report: populations that the fit has not seen."""
    begun = False
    for line in (Path(__file__).parents[2] / REPORT).read_text(encoding="utf-8").splitlines():
        begun |= line.startswith("|")
        if begun and not line:
            return
        if begun:
            yield line
