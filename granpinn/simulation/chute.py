r"""The settings of a chute: an even layer of grains on a rough base, released on a slope.

x runs down the slope and y across the layer, so gravity is g (sin, -cos). The sides are periodic:
what leaves on the right enters on the left. The base is a wall without slip. The surface lies
between two rows of cells: a cell that is partly filled has the viscosity of air, and glides.

Between the angles of mu_s and mu_2 the flow becomes steady (Bagnold flow). It takes a time of

$$ \frac{2 I_0}{3 (\mu_2 - \tan\theta)} \frac{H}{d} \sqrt{\frac{H}{g \cos\theta}}, $$

which is the momentum of the steady flow over the force that drives it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import ConfigError, setting
from granpinn.simulation.scene import CELLS_MULTIPLE, MOST_CELLS, SIZE, Scene, filled

STEEPEST = 60.0  # degrees
FEWEST_CELLS = 8
ROOM = 2.0  # height of the box over the depth of the layer: waves need room
COARSEST = 16  # cells along the slope on the coarsest grid, or more
USUAL_TIMES = 2.0  # the last time, in (H/d) sqrt(H/g)


@dataclass(frozen=True)
class Chute(Scene):
    """An even layer of grains on a rough base that is released on a slope at t = 0.

    Raises:
        ConfigError: the chute cannot be simulated; one sentence.
    """

    GRAINS = "layer"
    PERIODIC = True
    VISCOUS_TOLERANCE = 1e-7  # the last part of the way to a steady flow is slow
    PRESSURE_TOLERANCE = 1e-9  # rows of cells that are full remain full

    slope: float = setting(22.0, "angle of the slope in degrees", low=0, high=STEEPEST)
    g: float = setting(1.0, "strength of gravity", **SIZE)
    period: float | None = setting(
        None, "length after which the sides repeat, rounded up to cells; none: 8 cells", **SIZE
    )
    cells: int = setting(
        32, "cells across the depth of the layer", low=FEWEST_CELLS, high=MOST_CELLS / ROOM
    )

    stride: int = setting(
        1, "every how many cells one point of the grid is written", low=1, high=MOST_CELLS
    )

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **settings: Any) -> None: ...

    def _check(self) -> None:
        if self.d > self.height:
            raise ConfigError(
                f"d, the grain diameter, must be smaller than the depth {self.height:g} of the "
                f"layer, got {self.d:g}: check the units"
            )
        if self._wanted_columns > MOST_CELLS:
            raise ConfigError(
                f"period must be at most {MOST_CELLS} cells of {self.spacing:g}, got "
                f"{self.period:g}: give fewer --cells or a smaller period"
            )
        if 2 * self.stride > min(self.cells, self.cells_x):
            raise ConfigError(
                f"stride must leave two points across the layer and along the slope, got "
                f"{self.stride} with {self.cells_x} x {self.cells} cells: give a smaller one, or "
                f"more --cells or a longer --period"
            )
        self._check_memory()

    @property
    def gravity(self) -> tuple[float, float]:
        """Gravity in the axes of the chute, along the slope and across the layer."""
        angle = math.radians(self.slope)
        return self.g * math.sin(angle), -self.g * math.cos(angle)

    @property
    def spacing(self) -> float:
        return self.height / self.cells

    @property
    def _wanted_columns(self) -> float:
        return (self.period or CELLS_MULTIPLE * self.spacing) / self.spacing

    @property
    def chunk(self) -> int:
        chunk = CELLS_MULTIPLE
        while 2 * chunk * COARSEST <= self._wanted_columns:
            chunk *= 2
        return chunk

    @property
    def cells_x(self) -> int:
        return math.ceil(self._wanted_columns / self.chunk - 1e-9) * self.chunk

    @property
    def cells_y(self) -> int:
        return math.ceil(ROOM * self.cells / self.chunk) * self.chunk

    def start_fraction(self) -> Float64:
        return np.outer(filled(self.height, self.spacing, self.cells_y), np.ones(self.cells_x))

    def shape_attributes(self) -> dict[str, float | None]:
        return {"layer_depth": self.height, "slope": self.slope, "period_x": self.period}

    def _resolved(self) -> dict[str, Any]:
        usual = USUAL_TIMES * self.height / self.d * math.sqrt(self.height / self.g)
        t_end = self.t_end or min(usual, self._longest)
        period = self.cells_x * self.spacing
        return {**super()._resolved(), "t_end": t_end, "period": period}
