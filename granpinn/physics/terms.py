"""The terms of the residual loss, one row each in the order of csrc/problem.h; and its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from granpinn.physics.scales import Quantity

if TYPE_CHECKING:
    from torch import Tensor

Form = Literal["mixed", "strong"]  # residual: stress as an unknown, or the paper's


@dataclass(frozen=True)
class Term:
    """One term of the loss, the mean square of a residual.

    Attributes:
        name: in settings (`--weights.sigma_<name>`), history.csv and results.json.
        label: short, for the line that a run shows.
        quantity: physical quantity of the residual, which determines its unit.
        sigma: its standard deviation by default, in units of the flow
            (granpinn/training/problem.py); the term weighs 1/sigma^2.
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


class LossPoints(NamedTuple):
    """The points over which the terms are means, dimensionless; for E members, [E, ...].

    Attributes:
        points, velocity: interior points (x, y, t) [N, 3] and (u, v) measured there [N, 2].
        point_weights: weights of the velocity misfit and of the equations there [N, 2].
        surface_points, surface_pressure: points of the surface [M, 3] and the pressure there [M].
        source: force per mass beside gravity at the interior points [N, 2]; None: none.
    """

    points: Tensor
    velocity: Tensor
    point_weights: Tensor
    surface_points: Tensor
    surface_pressure: Tensor
    source: Tensor | None = None

    def at(self, inside: Tensor | slice, surface: Tensor | slice) -> LossPoints:
        """Some of the interior points and of the surface points, by their indices."""
        return LossPoints(
            self.points[..., inside, :],
            self.velocity[..., inside, :],
            self.point_weights[..., inside, :],
            self.surface_points[..., surface, :],
            self.surface_pressure[..., surface],
            None if self.source is None else self.source[..., inside, :],
        )

    def member(self, e: int) -> LossPoints:
        """The points of member e; members share what has no axis E."""
        ranks = (2, 2, 2, 2, 1, 2)
        pairs = zip(self, ranks, strict=True)
        return LossPoints._make(x if x is None or x.ndim == rank else x[e] for x, rank in pairs)
