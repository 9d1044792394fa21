"""The settings of a collapse: grains, column, box and grid, in one set of units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import ConfigError, setting
from granpinn.simulation.scene import CELLS_MULTIPLE, MOST_CELLS, SIZE, Scene, chunk_of, filled

FEWEST_CELLS = 32
FEWEST_CELLS_OF_COLUMN = 4


@dataclass(frozen=True)
class Collapse(Scene):
    """A column of grains that is released at t = 0, against a wall on its left.

    Raises:
        ConfigError: the collapse cannot be simulated; one sentence.
    """

    GRAINS = "column"

    aspect: float = setting(10.0, "height / width of the column", low=1e-3, high=1e3)
    gravity: tuple[float, float] = setting(
        (0.0, -1.0), "gravity: two numbers; tilted box: g_x > 0", low=-1e12, high=1e12
    )
    box_width: float | None = setting(
        None, "width of the box; none: 1.2 x height of the column", **SIZE
    )
    box_height: float | None = setting(
        None, "height of the box; none: 1.2 x height of the column", **SIZE
    )
    cells: int = setting(
        512,
        "cells across the width of the box, a multiple of 8",
        low=FEWEST_CELLS,
        high=MOST_CELLS,
    )

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **settings: Any) -> None: ...

    def _check(self) -> None:
        if self.gravity[1] > -SIZE["low"]:
            raise ConfigError(f"gravity must point down, got {self.gravity}")
        if self.cells % CELLS_MULTIPLE:
            raise ConfigError(f"cells must be a multiple of {CELLS_MULTIPLE}, got {self.cells}")
        width, height = self.box
        if self.width >= width or self.height >= height:
            raise ConfigError(
                f"the column, {self.width:g} wide and {self.height:g} high, must fit into the box "
                f"of {width:g} x {height:g}: give a larger --box-width or --box-height"
            )
        narrow = min(self.width, self.height) / self.spacing
        if narrow < FEWEST_CELLS_OF_COLUMN:
            raise ConfigError(
                f"the column must be at least {FEWEST_CELLS_OF_COLUMN} cells wide and high, got "
                f"{narrow:.1f}: give more --cells or a smaller box"
            )
        if self.stride > narrow:
            raise ConfigError(f"stride {self.stride} leaves no points across the column")
        if self.d > min(self.width, self.height):
            raise ConfigError(
                f"d, the grain diameter, must be smaller than the column, {self.width:g} wide and "
                f"{self.height:g} high, got {self.d:g}: check the units"
            )
        if self.cells_y > MOST_CELLS:
            raise ConfigError(
                f"the box must be at most {MOST_CELLS} cells high, got {self.cells_y}: give fewer "
                "--cells or a smaller --box-height"
            )
        self._check_memory()

    @property
    def width(self) -> float:
        return self.height / self.aspect

    @property
    def box(self) -> tuple[float, float]:
        """Width and height of the box, before the height is rounded up to whole cells."""
        default = 1.2 * self.height
        return self.box_width or default, self.box_height or default

    @property
    def spacing(self) -> float:
        return self.box[0] / self.cells

    @property
    def chunk(self) -> int:
        return chunk_of(self.cells)

    @property
    def cells_x(self) -> int:
        return self.cells

    @property
    def cells_y(self) -> int:
        return math.ceil(self.box[1] / self.spacing / self.chunk - 1e-9) * self.chunk

    def start_fraction(self) -> Float64:
        """A rectangle in the lower left corner."""
        h = self.spacing
        rows, columns = filled(self.height, h, self.cells_y), filled(self.width, h, self.cells_x)
        return np.outer(rows, columns)

    def shape_attributes(self) -> dict[str, float | None]:
        return {
            "column_height": self.height,
            "column_width": self.width,
            "box_width": self.box_width,
            "box_height": self.box_height,
        }

    def _resolved(self) -> dict[str, Any]:
        box = {"box_width": self.box[0], "box_height": self.cells_y * self.spacing}
        return {**box, **super()._resolved()}
