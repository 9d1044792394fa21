"""The numbers of the error model, from granpinn/uncertainty/error_model.json."""

from __future__ import annotations

from collections.abc import Iterator

from granpinn.uncertainty import error_model

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


def table() -> str:
    """The coefficients, and the other numbers."""
    return "\n".join(lines())


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
