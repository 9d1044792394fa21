"""The settings of a simulation: grains, column, box and grid, in one set of units.

The fields are also the command line of ``python -m granpinn.simulate``. A field that is ``None``
takes the value of the paper's collapse, scaled to the units of this one.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from granpinn.config import ConfigError, setting
from granpinn.physics.law_values import CompleteLaw
from granpinn.physics.laws import Law

# The paper's column: 10 high and 1 wide under g = 1, with eta_max = 1e4 and air of 1e-4.
PAPER_HEIGHT = 10.0
PAPER_ETA_MAX = 1e4
PAPER_AIR_DENSITY = 1e-4
PAPER_AIR_VISCOSITY = 1e-4
PAPER_LARGEST_STEP = 1e-2
# (mu_s, mu_2) of mu(I) in the six regimes of its figure 3.
PAPER_CASES = ((0.2, 0.32), (0.2, 0.44), (0.4, 0.52), (0.4, 0.64), (0.6, 0.72), (0.6, 0.84))

FEWEST_CELLS = 32
FEWEST_CELLS_OF_COLUMN = 4
CELLS_MULTIPLE = 8
MARGIN = 8  # cells of air around the grains
MOST_THREADS = 4


@dataclass(frozen=True)
class Collapse(CompleteLaw):
    """A column of grains that is released at t = 0, against a wall on its left.

    The first fields are the parameters of the friction law, such as mu_s, mu_2, I0, then `law`.

    Raises:
        ConfigError: the collapse cannot be simulated; one sentence.
    """

    d: float = setting(0.025, "grain diameter")
    cohesion: float = setting(0.0, "cohesive stress, added to the friction mu p")
    height: float = setting(10.0, "height of the column")
    aspect: float = setting(10.0, "height / width of the column")
    density: float = setting(1.0, "bulk density of the grains")
    gravity: tuple[float, float] = setting((0.0, -1.0), "gravity: two numbers; tilted box: g_x > 0")
    box_width: float | None = setting(None, "width of the box; none: 1.2 x height of the column")
    box_height: float | None = setting(None, "height of the box; none: 1.2 x height of the column")
    cells: int = setting(512, "cells across the width of the box, a multiple of 8")
    t_end: float | None = setting(None, "last time; none: 5 for the paper's column, scaled")
    frames: int = setting(200, "number of frames, evenly spaced in time up to t_end")
    stride: int = setting(4, "every how many cells one point of the grid is written")
    eta_min: float | None = setting(None, "floor of the viscosity; none: that of the air")
    eta_max: float | None = setting(None, "upper clamp of the viscosity; none: 1e4, scaled")
    air_density: float | None = setting(None, "density of the air; none: 1e-4 of the grains'")
    air_viscosity: float | None = setting(None, "viscosity of the air; none: 1e-4, scaled")
    cfl: float = setting(0.5, "cells per time step at most, at most 0.5")
    length_unit: str = setting("1", "name of the unit of length, for the flow file")
    time_unit: str = setting("1", "name of the unit of time")
    threads: int | None = setting(None, "threads; none: the processors at hand, at most 4")

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **settings: Any) -> None: ...

    def __post_init__(self) -> None:
        try:
            super().__post_init__()
        except ValueError as error:
            raise ConfigError(str(error)) from None
        positive = ("d", "height", "aspect", "density", "cfl", "cells", "frames", "stride")
        optional = ("box_width", "box_height", "t_end", "eta_min", "eta_max", "threads")
        for name in (*positive, *optional, "air_density", "air_viscosity"):
            value = getattr(self, name)
            if value is None and name not in positive:
                continue
            if not (math.isfinite(value) and value > 0):
                raise ConfigError(f"{name} must be a positive number, got {value}")
        if not (math.isfinite(self.cohesion) and self.cohesion >= 0):
            raise ConfigError(f"cohesion must not be negative, got {self.cohesion}")
        if len(self.gravity) != 2 or not all(map(math.isfinite, self.gravity)):
            raise ConfigError(f"gravity must be two numbers, got {self.gravity}")
        if self.gravity[1] >= 0:
            raise ConfigError(f"gravity must point down, g_y < 0, got {self.gravity}")
        if self.cfl > 0.5:
            raise ConfigError(f"cfl must be at most 0.5 for the volume of fluid, got {self.cfl}")
        self._check_grid()

    def _check_grid(self) -> None:
        if self.cells < FEWEST_CELLS or self.cells % CELLS_MULTIPLE:
            raise ConfigError(
                f"cells must be a multiple of {CELLS_MULTIPLE} and at least {FEWEST_CELLS}, "
                f"got {self.cells}"
            )
        if self.frames < 2:
            raise ConfigError(f"frames must be at least 2, got {self.frames}")
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

    @property
    def width(self) -> float:
        return self.height / self.aspect

    @property
    def spacing(self) -> float:
        """Cell size."""
        return self.box[0] / self.cells

    @property
    def box(self) -> tuple[float, float]:
        """Width and height of the box, before the height is rounded up to whole cells."""
        default = 1.2 * self.height
        return self.box_width or default, self.box_height or default

    @property
    def chunk(self) -> int:
        """Cells by which the window grows: a power of two that divides the box."""
        chunk = CELLS_MULTIPLE
        while self.cells % (2 * chunk) == 0 and 2 * chunk <= self.cells // 32:
            chunk *= 2
        return chunk

    @property
    def cells_y(self) -> int:
        """Cells across the height of the box, rounded up to whole chunks."""
        return math.ceil(self.box[1] / self.spacing / self.chunk - 1e-9) * self.chunk

    def resolved(self) -> Collapse:
        """The same collapse with a number in the place of every ``None``."""
        # Free fall from the top of the paper's column takes sqrt(2 x 10); scale by sqrt(H / g).
        g = math.hypot(*self.gravity)
        time = math.sqrt(self.height / PAPER_HEIGHT / g)
        stress_time = self.density * g * (self.height / PAPER_HEIGHT) * time
        air_viscosity = self.air_viscosity or PAPER_AIR_VISCOSITY * stress_time
        return replace(
            self,
            box_width=self.box[0],
            box_height=self.cells_y * self.spacing,
            t_end=self.t_end or 5 * time,
            eta_min=self.eta_min or air_viscosity,
            eta_max=self.eta_max or PAPER_ETA_MAX * stress_time,
            air_density=self.air_density or PAPER_AIR_DENSITY * self.density,
            air_viscosity=air_viscosity,
            threads=self.threads or min(os.cpu_count() or 1, MOST_THREADS),
        )

    @property
    def largest_step(self) -> float:
        g = math.hypot(*self.gravity)
        return PAPER_LARGEST_STEP * math.sqrt(self.height / PAPER_HEIGHT / g)


def law_settings(law: Law, theta: Sequence[float]) -> dict[str, Any]:
    """Keyword arguments of `Collapse` for this friction law with the parameters theta [N]."""
    return {"law": law.name, **dict(zip(law.names, theta, strict=True))}
