"""A likely mistake in a flow file: one of unit, sign, size or order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

IMPOSSIBLE: Final = "impossible"
IMPROBABLE: Final = "improbable"
UNUSUAL: Final = "unusual"
SEVERITIES = (IMPOSSIBLE, IMPROBABLE, UNUSUAL)


@dataclass(frozen=True)
class Slip:
    """A likely mistake in a flow file.

    Attributes:
        severity: "impossible" contradicts a conservation law, and training refuses it. Where it is
            "improbable", a law from the data is probably wrong. A size that is "unusual" may be
            right.
        text: one sentence: what contradicts what, and what to check.
    """

    severity: str
    text: str

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            expected = ", ".join(SEVERITIES)
            raise ValueError(f"severity must be one of {expected}, got {self.severity!r}")

    def __str__(self) -> str:
        return f"{self.severity}: {self.text}"
