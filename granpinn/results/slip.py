"""A likely mistake in a flow file: one of unit, sign, size or order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

IMPOSSIBLE: Final = "impossible"
IMPROBABLE: Final = "improbable"


@dataclass(frozen=True)
class Slip:
    """A likely mistake in a flow file.

    Attributes:
        severity: "impossible" contradicts a conservation law; training refuses it.
        text: one sentence: what contradicts what, and what to check.
    """

    severity: Literal["impossible", "improbable"]
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.text}"
