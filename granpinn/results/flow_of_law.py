"""One of several flows that have one friction law, with its own facts."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.results.assessment import Assessment
from granpinn.results.named import Residuals
from granpinn.results.records import DataSummary, Input


@dataclass(frozen=True)
class FlowOfLaw:
    """
    Attributes:
        I_range: 5th and 95th percentile of I over its points that shear; None without any.
        residuals: of its network, which has the shared law.
        assessment: of the fit of this flow.
    """

    input: Input
    data: DataSummary
    I_range: tuple[float, float] | None
    residuals: Residuals | None
    assessment: Assessment

    def __str__(self) -> str:
        """The line for the terminal."""
        return f"{self.input.name}: {self.shear}, {self.assessment.headline}"

    @property
    def shear(self) -> str:
        """Its range of I in words."""
        if self.I_range is None:
            return "no grains shear"
        low, high = self.I_range
        return f"I = {low:.2g} to {high:.2g}"
