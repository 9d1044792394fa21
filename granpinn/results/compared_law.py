"""A friction law of a comparison."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.results.parameters import Parameters


@dataclass(frozen=True)
class ComparedLaw:
    """A law, as near to the free curve as it comes.

    Attributes:
        law: its name.
        parameters: of the law that is nearest to the free curve; not those of the identification.
        not_told_apart_from: names of laws whose curves differ by less than the band of the free
            curve.
    """

    law: str
    parameters: Parameters
    not_told_apart_from: tuple[str, ...] = ()
