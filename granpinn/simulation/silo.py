r"""The settings of a silo: grains between two walls that leave through an opening in the floor.

The opening is in the middle of the floor. There p = 0 and no traction holds, so grains fall out and
the jet below is not computed. The floor beside it is rough: nothing slips there. The walls on both
sides are rough too, or smooth, without friction. Air comes in at the top.

The discharge hardly depends on the height of the filling. Through an opening of width w

$$ Q = C \sqrt{g}\, w^{3/2} $$

leaves in a unit of time (Beverloo, Leniger and van de Velde 1961, Chem. Eng. Sci. 15, here in two
dimensions and without the grain diameter, by which the width is less for grains).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import ConfigError, setting
from granpinn.data.flow import Walls
from granpinn.simulation.scene import CELLS_MULTIPLE, MOST_CELLS, SIZE, Scene, chunk_of, filled

FEWEST_CELLS = 16
FEWEST_CELLS_OF_OPENING = 4
AIR_ABOVE = 8  # cells
SLENDER, NARROW = 0.5, 0.25  # width over height, and opening over width, unless they are given
USUAL_SHARE = 0.4  # of the grains would leave before the last time with C = 1


@dataclass(frozen=True)
class Silo(Scene):
    """Grains in a silo with a flat floor, whose opening is free from t = 0 on.

    Raises:
        ConfigError: the silo cannot be simulated; one sentence.
    """

    GRAINS = "filling"
    LEVEL_SURFACE = True

    width: float | None = setting(
        None, "distance of the walls; none: half of the height of the filling", **SIZE
    )
    outlet: float | None = setting(
        None,
        "width of the opening, rounded to an even number of cells; none: a quarter of the floor",
        **SIZE,
    )
    sides: Literal["rough", "smooth"] = setting(
        "rough", "the walls on both sides: rough, grains stick to them; smooth, no friction"
    )
    g: float = setting(1.0, "strength of gravity", **SIZE)
    cells: int = setting(
        64,
        "cells across the width of the silo, a multiple of 8",
        low=FEWEST_CELLS,
        high=MOST_CELLS,
    )
    stride: int = setting(
        1, "every how many cells one point of the grid is written", low=1, high=MOST_CELLS
    )

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **settings: Any) -> None: ...

    def _check(self) -> None:
        if self.cells % CELLS_MULTIPLE:
            raise ConfigError(f"cells must be a multiple of {CELLS_MULTIPLE}, got {self.cells}")
        if self._wanted_outlet > self._width * (1 + 1e-9):
            raise ConfigError(
                f"outlet must be at most the width {self._width:g} of the silo, got "
                f"{self._wanted_outlet:g}: give a smaller one, or a larger --width"
            )
        if self._open_cells < FEWEST_CELLS_OF_OPENING:
            raise ConfigError(
                f"the opening must be at least {FEWEST_CELLS_OF_OPENING} cells wide, got "
                f"{self._wanted_outlet / self.spacing:.1f}: give more --cells or a larger --outlet"
            )
        rows = self.height / self.spacing
        if rows < CELLS_MULTIPLE:
            raise ConfigError(
                f"the filling must be at least {CELLS_MULTIPLE} cells high, got {rows:.1f}: give "
                "more --cells or a larger --height"
            )
        if self.cells_y > MOST_CELLS:
            raise ConfigError(
                f"the filling must be at most {MOST_CELLS - AIR_ABOVE} cells high, got "
                f"{rows:.0f}: give fewer --cells or a larger --width"
            )
        if self.d > min(self._wanted_outlet, self.height):
            raise ConfigError(
                f"d, the grain diameter, must be smaller than the opening, "
                f"{self._wanted_outlet:g} wide, and the filling, {self.height:g} high, got "
                f"{self.d:g}: check the units"
            )
        if 2 * self.stride > min(self._open_cells, rows):
            raise ConfigError(
                f"stride must leave two points across the opening and the filling, got "
                f"{self.stride} with {self._open_cells} and {rows:.0f} cells: give a smaller one, "
                "or more --cells"
            )
        self._check_memory()

    @property
    def _width(self) -> float:
        return self.width or SLENDER * self.height

    @property
    def _wanted_outlet(self) -> float:
        return self.outlet or NARROW * self._width

    @property
    def _open_cells(self) -> int:
        return 2 * round(self._wanted_outlet / self.spacing / 2)

    @property
    def gravity(self) -> tuple[float, float]:
        """Gravity along the walls of the silo."""
        return 0.0, -self.g

    @property
    def spacing(self) -> float:
        return self._width / self.cells

    @property
    def chunk(self) -> int:
        return chunk_of(self.cells)

    @property
    def cells_x(self) -> int:
        return self.cells

    @property
    def cells_y(self) -> int:
        rows = self.height / self.spacing + AIR_ABOVE
        return math.ceil(rows / self.chunk - 1e-9) * self.chunk

    @property
    def side_conditions(self) -> tuple[str, str]:
        side = "no_slip" if self.sides == "rough" else "free_slip"
        return side, side

    @property
    def opening(self) -> tuple[int, int]:
        first = (self.cells - self._open_cells) // 2
        return first, first + self._open_cells

    def start_fraction(self) -> Float64:
        return np.outer(filled(self.height, self.spacing, self.cells_y), np.ones(self.cells))

    def walls(self) -> Walls:
        """The two sides and what is left of the floor."""
        first, last = (n * self.spacing for n in self.opening)
        side = 1.0 if self.sides == "smooth" else 0.0
        pieces = [
            ((0.0, self.height), (0.0, 0.0), side),
            ((0.0, 0.0), (first, 0.0), 0.0),
            ((last, 0.0), (self._width, 0.0), 0.0),
            ((self._width, 0.0), (self._width, self.height), side),
        ]
        if self._open_cells == self.cells:
            pieces = [pieces[0], pieces[-1]]
        gap = (np.nan, np.nan, 0.0)
        points = [p for a, b, slip in pieces for p in ((*a, slip), (*b, slip), gap)][:-1]
        x, y, slip = np.array(points).T.copy()
        return Walls(x, y, slip=slip.astype(np.float32))

    def shape_attributes(self) -> dict[str, float | None]:
        return {
            "filling_height": self.height,
            "silo_width": self.width,
            "outlet_width": self.outlet,
        }

    def _resolved(self) -> dict[str, Any]:
        outlet = self._open_cells * self.spacing
        usual = USUAL_SHARE * self._width * self.height / (outlet * math.sqrt(self.g * outlet))
        t_end = self.t_end or min(usual, self._longest)
        return {**super()._resolved(), "t_end": t_end, "width": self._width, "outlet": outlet}
