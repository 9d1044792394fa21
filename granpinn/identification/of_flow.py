"""What the results of all members need of a flow alone: each made once, also between threads."""

from __future__ import annotations

from threading import Lock

from granpinn.arrays import Floats
from granpinn.data import Flow
from granpinn.data.surface_sd import surface_sd
from granpinn.identification.scoring import strain_rate_of


class OfFlow:
    """
    Args:
        flow: as in its file; of a large flow, frames spread over its time.
    """

    def __init__(self, flow: Flow) -> None:
        self.flow, self._lock = flow, Lock()
        self._sd: dict[str, float] = {}
        self._rate: Floats | None = None

    def surface_sd(self, level: str) -> float:
        """Standard deviation of the offset of its surface line (granpinn/data/surface_sd.py)."""
        with self._lock:
            if level not in self._sd:
                self._sd[level] = surface_sd(self.flow, level)
            return self._sd[level]

    def strain_rate(self) -> Floats:
        """D2 of its velocity at the points of its fields [K]."""
        with self._lock:
            if self._rate is None:
                self._rate = strain_rate_of(self.flow)
            return self._rate
