"""The record of an assumption that the data do not contain, and of its effect on the law."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Assumed:
    """One assumption of an identification (uncertainty/sensitivity.py).

    Attributes:
        name: of the assumption.
        unit: of its value, "1" without one.
        sd: standard deviation of its value, from the file or by rule.
        derivative: of every identified parameter by the value, in 1/unit; None: not known.
        example: a change of the assumption in words.
        percent: change of every parameter by the example, relative to its value.
        why: the reason for an unknown derivative.
    """

    name: str
    unit: str
    sd: float
    derivative: dict[str, float] | None
    example: str
    percent: dict[str, float] | None = None
    why: str | None = None

    def __str__(self) -> str:
        """The line for the terminal."""
        known = f"known to {self.sd:.3g}" + (f" {self.unit}" if self.unit != "1" else "")
        if self.percent is None:
            return f"{self.name} ({known}): its effect is not known: {self.why}"
        changes = ", ".join(f"{name} {value:+.1f} %" for name, value in self.percent.items())
        return f"{self.example}: {changes} ({self.name} {known})"
