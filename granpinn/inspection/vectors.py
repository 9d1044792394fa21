"""The vectors: how many, and where they are missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, Check, Reason, Record

MANY_INVALID = 0.1


@dataclass(frozen=True)
class Vectors(Record):
    """
    Attributes:
        count: of the valid ones.
        rows, columns: of the grid; of scattered vectors, of their view on a grid.
        invalid_share: share of the cells full of grains that have no vector; None if scattered.
    """

    title = "vectors"

    count: int
    scattered: bool
    rows: int
    columns: int
    invalid_share: float | None

    @property
    def words(self) -> str:
        kind = "scattered" if self.scattered else f"on {self.rows} x {self.columns} cells"
        share = self.invalid_share
        gaps = "" if share is None else f", {share:.1%} of the grains without"
        return f"{self.count} {kind}{gaps}"

    def reasons(self, of: Inspection) -> list[Reason]:
        if self.invalid_share is None or self.invalid_share <= MANY_INVALID:
            return []
        text = (
            f"{self.invalid_share:.0%} of the grains have no valid vector: see validity.png; "
            "more light, more texture or larger windows help."
        )
        return [Reason(ADVICE, text)]

    def figures(self) -> dict[str, tuple[str, Callable[[Inspection], Any]]]:
        return {"validity": ("Valid vectors", _share_of_valid), "speed": ("Speed", _speed)}


def make(inspection: Inspection) -> Vectors:
    view, invalid = inspection.facts.view, None
    scattered = inspection.flow.particles is not None
    if not scattered:
        invalid = 1 - int(view.there.sum()) / int(view.grains.sum())
    return Vectors(int(view.count.sum()), scattered, view.y.size, view.x.size, invalid)


def _share_of_valid(inspection: Inspection) -> Any:
    """Share of valid vectors in every cell, among the frames in which it is full of grains."""
    from granpinn.figures.maps import map_of_grid

    view, flow = inspection.facts.view, inspection.flow
    grains, there = view.grains.sum(axis=0), (view.there & view.grains).sum(axis=0)
    share = np.divide(there, grains, out=np.full(grains.shape, np.nan), where=grains > 0)
    return map_of_grid(flow, share, "share of valid vectors", (0.0, 1.0))


def _speed(inspection: Inspection) -> Any:
    """The speed in the frame with the largest mean speed."""
    from granpinn.figures.maps import map_of_grid
    from granpinn.figures.style import label

    flow = inspection.flow
    size = np.where(flow.valid, np.hypot(flow.u, flow.v), np.nan)
    n = np.maximum(flow.valid.sum(axis=(1, 2)), 1)
    k = int(np.argmax(np.nansum(size, axis=(1, 2)) / n))
    drawing = map_of_grid(flow, size[k], label("$|v|$", inspection.velocity_unit))
    drawing.figure.axes[0].set_title(f"t = {flow.t[k]:.4g}")
    return drawing


CHECK = Check("vectors", Vectors, make, seconds=0.02, quick=False)
