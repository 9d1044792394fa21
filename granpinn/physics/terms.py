"""The terms of the residual loss, one row each: the order is that of csrc/problem.h."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from granpinn.physics.scales import Quantity

Form = Literal["mixed", "strong"]  # residual: stress as an unknown, or the paper's
FORMS: tuple[Form, ...] = get_args(Form)


@dataclass(frozen=True)
class Term:
    """One term of the loss, the mean square of a residual.

    Attributes:
        name: in settings (`--weights.sigma_<name>`), history.csv and results.json.
        label: short, for the line that a run shows.
        quantity: physical quantity of the residual, which determines its unit.
        sigma: its standard deviation by default, in units of the flow
            (granpinn/training/tolerances.py); the term weighs 1/sigma^2.
        help: what the residual is, in words.
    """

    name: str
    label: str
    quantity: Quantity
    sigma: float
    help: str


TERMS: tuple[Term, ...] = (
    Term("velocity", "vel", "velocity", 0.007, "velocity that the network cannot resolve"),
    Term("surface", "surf", "pressure", 0.002, "pressure on the free surface"),
    Term("momentum", "mom", "force", 0.05, "momentum residual"),
    Term("continuity", "div", "rate", 0.033, "divergence of the velocity"),
    Term(
        "constitutive", "law", "rate", 0.008, "strain rate error in the friction law (mixed form)"
    ),
)

NAMES: tuple[str, ...] = tuple(term.name for term in TERMS)
LAW = NAMES.index("constitutive")  # the term of the friction law

RESIDUALS: dict[str, tuple[str, ...]] = {
    "strong": ("momentum", "momentum", "continuity"),
    "mixed": ("momentum", "momentum", "continuity", "constitutive", "constitutive"),
}
"""The terms of the residuals of a form, in the order of csrc/math/forms."""
