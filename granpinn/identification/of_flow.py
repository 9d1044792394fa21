"""What the results of all members need of a flow alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from granpinn.arrays import Floats
from granpinn.data import Flow
from granpinn.data.surface_sd import surface_sd
from granpinn.identification.once import Once
from granpinn.identification.scoring import strain_rate_of


class OfFlow:
    """
    Args:
        flow: as in its file; of a large flow, frames spread over its time.

    Attributes:
        surface_sd: of a level, the standard deviation of the offset of the surface line
            (granpinn/data/surface_sd.py).
        strain_rate: D2 of its velocity at the points of its fields [K].
    """

    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self.surface_sd: Once[str, float] = Once(lambda level: surface_sd(flow, level))
        self.strain_rate: Callable[[], Floats] = partial(Once(strain_rate_of), flow)
