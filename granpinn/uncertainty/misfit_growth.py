"""How the errors of the law grow with the misfit of the velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class MisfitGrowth:
    """How errors grow with the misfit of the velocity, measured on films of simulated collapses.

    The residuals of films imply a part of their misfit only: the rest is noise. Where the residuals
    imply all of it, the network misses structure of the flow, such as shear bands. The errors at
    the lower end of the range of I are then in proportion to the misfit.

    Attributes:
        power: of the misfit, to which the errors of films are proportional.
        largest: misfit of the films over that of the table; errors grow in proportion from there.
        implied: misfit that the residuals imply over the misfit, of films at most.
        flows: number of films.
        provenance: the trainings that gave the numbers.
    """

    power: float
    largest: float
    implied: float
    flows: int
    provenance: str

    def __post_init__(self) -> None:
        if not 0 <= self.power <= 1 <= self.largest:
            raise ValueError(f"power must be 0 to 1, largest at least 1, got {self}")
        if not 0 < self.implied < 1:
            raise ValueError(f"implied must be above 0 and below 1, got {self.implied}")

    def factor(self, ratio: float) -> float:
        """On the errors at a misfit of `ratio` times, at least 1, that of the table."""
        return math.pow(min(ratio, self.largest), self.power) * max(1.0, ratio / self.largest)

    def of_structure(self, ratio: float, implied: float) -> float:
        """Further factor on the errors at the lower end of the range of I.

        Args:
            implied: misfit that the residuals imply over the misfit, 0 to 1. From that of films to
                1, the power of the misfit rises to 1.
        """
        share = max(0.0, (implied - self.implied) / (1 - self.implied))
        return math.pow(min(ratio, self.largest), share * (1 - self.power))
