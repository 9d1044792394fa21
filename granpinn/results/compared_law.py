"""A friction law of a comparison, and how well it explains the data."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.results.parameters import Parameters


@dataclass(frozen=True)
class ComparedLaw:
    """A law and how well it explains the data.

    Attributes:
        law: its name.
        parameters: of the law that is nearest to the free curve; not those of the identification.
        score: log likelihood of blocks of time that were left out, relative to the best law.
        not_told_apart_from: names of laws whose curves differ by less than the band of the free
            curve.
    """

    law: str
    parameters: Parameters
    score: float
    not_told_apart_from: tuple[str, ...] = ()
