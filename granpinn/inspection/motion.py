"""The motion of the grains from frame to frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.estimates.robust import quantiles
from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, Check, Reason, Record

# Between two frames the fastest grains should move less than this, in units of H0: the shear
# layers of a collapse are about ten times thicker.
LARGEST_MOVE = 0.05
FASTEST = 0.99  # quantile


@dataclass(frozen=True)
class Motion(Record):
    """
    Attributes:
        speed: the largest one.
        cells_per_frame: distance of the fastest grains from one frame to the next, in cells; None
            for a steady flow, whose frames need not follow each other.
        largest_move: the same distance in units of H0, for the worst pair of frames, or None.
        sparse: (start, end) of the longest run of frames that are too far apart.
        unit: of the speed, behind a number, with a space.
    """

    title = "motion"

    speed: float
    cells_per_frame: float | None
    largest_move: float | None
    sparse: tuple[float, float] | None
    unit: str

    @property
    def words(self) -> str:
        cells = self.cells_per_frame
        moves = "" if cells is None else f"; {cells:.2g} cells per frame"
        return f"largest speed {self.speed:.3g}{self.unit}{moves}"

    def reasons(self, of: Inspection) -> list[Reason]:
        if self.sparse is None or self.largest_move is None:
            return []
        start, end = self.sparse
        text = (
            f"Add frames between t = {start:.4g} and {end:.4g}{of.time_unit}: grains move up to "
            f"{self.largest_move:.2f} of the initial height from one to the next; a frame rate "
            f"{math.ceil(self.largest_move / LARGEST_MOVE)} times higher resolves the motion."
        )
        return [Reason(ADVICE, text)]

    def figures(self) -> dict[str, tuple[str, Callable[[Inspection], Any]]]:
        return {"speed": ("Speed", _map)}


def make(inspection: Inspection) -> Motion:
    flow, view, found = inspection.flow, inspection.facts.view, inspection.facts.slopes
    noise = inspection["noise"]
    if view.steady:
        return Motion(noise.speed, None, None, None, noise.unit)
    # Of the smoothed velocity: that of single vectors contains noise.
    size = np.hypot(found.u, found.v)
    fastest = quantiles(size, found.index[0], view.t.size, FASTEST)
    moves = np.diff(view.t) * np.maximum(fastest[1:], fastest[:-1])
    cells = float(np.quantile(moves, FASTEST) / min(view.steps[1:]))
    sparse = _longest_run(moves > LARGEST_MOVE, flow.t)
    return Motion(noise.speed, cells, float(moves.max()), sparse, noise.unit)


def _longest_run(marked: Bool, t: Float64) -> tuple[float, float] | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(int), [0]])))
    if edges.size == 0:
        return None
    start, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda run: run[1] - run[0])
    return float(t[start]), float(t[end])


def _map(inspection: Inspection) -> Any:
    """The speed in the frame with the largest mean speed."""
    from granpinn.figures.maps import map_of_grid
    from granpinn.figures.style import label

    view, flow = inspection.facts.view, inspection.flow
    size = np.where(view.there, np.hypot(view.u, view.v), np.nan) * inspection.scales.velocity
    n = view.there.sum(axis=(1, 2))
    mean = np.divide(np.nansum(size, axis=(1, 2)), n, out=np.zeros(n.size), where=n > 0)
    k = int(np.argmax(mean))
    drawing = map_of_grid(flow, size[k], label("$|v|$", inspection.velocity_unit))
    drawing.figure.axes[0].set_title(f"t = {flow.t[k]:.4g}")
    return drawing


CHECK = Check("motion", Motion, make, seconds=0.04, quick=False)
