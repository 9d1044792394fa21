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

from granpinn.config import ConfigError, Walls, setting
from granpinn.config.fields import settings_of
from granpinn.config.values import typed
from granpinn.physics.law_values import CompleteLaw
from granpinn.physics.laws import Law

# The paper's column: 10 high and 1 wide under g = 1, with eta_max = 1e4 and air of 1e-4.
PAPER_HEIGHT = 10.0
PAPER_ETA_MAX = 1e4
PAPER_AIR_DENSITY = 1e-4
PAPER_AIR_VISCOSITY = 1e-4
PAPER_LARGEST_STEP = 1e-2
USUAL_WALLS = Walls()
# (mu_s, mu_2) of mu(I) in the six regimes of its figure 3.
PAPER_CASES = ((0.2, 0.32), (0.2, 0.44), (0.4, 0.52), (0.4, 0.64), (0.6, 0.72), (0.6, 0.84))

# Any unit of length, time and mass is possible. Products of sizes in this range are far from the
# largest and smallest float64.
SIZE: dict[str, float] = {"low": 1e-12, "high": 1e12}
VISCOSITY: dict[str, float] = {"low": 1e-30, "high": 1e30}
FEWEST_CELLS = 32
MOST_CELLS = 16384  # in a direction; the solver counts cells in 32 bits
LONGEST = 1000.0  # last time, in units of sqrt(2 height / |g|), the time of free fall
STATE_BYTES = 800  # of the solver for each cell
FEWEST_CELLS_OF_COLUMN = 4
CELLS_MULTIPLE = 8
MARGIN = 8  # cells of air around the grains
USUAL_THREADS = 4


@dataclass(frozen=True)
class Collapse(CompleteLaw):
    """A column of grains that is released at t = 0, against a wall on its left.

    The first fields are the parameters of the friction law, such as mu_s, mu_2, I0, then `law`.

    Raises:
        ConfigError: the collapse cannot be simulated; one sentence.
    """

    d: float = setting(0.025, "grain diameter", **SIZE)
    cohesion: float = setting(0.0, "cohesive stress, added to the friction mu p", low=0, high=1e30)
    height: float = setting(10.0, "height of the column", **SIZE)
    aspect: float = setting(10.0, "height / width of the column", low=1e-3, high=1e3)
    density: float = setting(1.0, "bulk density of the grains", **SIZE)
    gravity: tuple[float, float] = setting(
        (0.0, -1.0), "gravity: two numbers; tilted box: g_x > 0", low=-1e12, high=1e12
    )
    wall_gap: float | None = setting(
        None, "distance of side walls, whose friction slows the grains; none: no side walls", **SIZE
    )
    wall_friction: float | None = setting(
        None, f"friction of the side walls; none: {USUAL_WALLS.friction}", low=0, high=2
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
    t_end: float | None = setting(None, "last time; none: 5 for the paper's column, scaled", **SIZE)
    frames: int = setting(
        200, "number of frames, evenly spaced in time up to t_end", low=2, high=100_000
    )
    stride: int = setting(
        4, "every how many cells one point of the grid is written", low=1, high=MOST_CELLS
    )
    eta_min: float | None = setting(
        None, "floor of the viscosity; none: that of the air", **VISCOSITY
    )
    eta_max: float | None = setting(
        None, "upper clamp of the viscosity; none: 1e4, scaled", **VISCOSITY
    )
    air_density: float | None = setting(
        None, "density of the air; none: 1e-4 of the grains'", **SIZE
    )
    air_viscosity: float | None = setting(
        None, "viscosity of the air; none: 1e-4, scaled", **VISCOSITY
    )
    cfl: float = setting(0.5, "cells per time step at most, at most 0.5", low=0.01, high=0.5)
    length_unit: str = setting("1", "name of the unit of length, for the flow file")
    time_unit: str = setting("1", "name of the unit of time")
    threads: int | None = setting(
        None, "threads; none: the processors at hand, at most 4", low=1, high=256
    )

    if TYPE_CHECKING:

        def __init__(self, *theta: float | None, law: str = "", **settings: Any) -> None: ...

    def __post_init__(self) -> None:
        for name, stated in settings_of(Collapse).items():
            value = typed(getattr(self, name), stated.kind, name)
            stated.check(value, name)
            object.__setattr__(self, name, value)
        try:
            super().__post_init__()
        except ValueError as error:
            raise ConfigError(str(error)) from None
        if len(self.gravity) != 2 or self.gravity[1] > -SIZE["low"]:
            raise ConfigError(f"gravity must be two numbers and point down, got {self.gravity}")
        if self.wall_friction is not None and self.wall_gap is None:
            raise ConfigError("wall_friction needs the distance of the side walls: give wall_gap")
        self._check_grid()
        r = self._resolved()
        if not r["eta_min"] < r["eta_max"]:
            raise ConfigError(
                f"eta_min must be below eta_max = {r['eta_max']:g}, got {r['eta_min']:g}"
            )
        longest = LONGEST * math.sqrt(2 * self.height / math.hypot(*self.gravity))
        if r["t_end"] > longest:
            raise ConfigError(
                f"t_end must be at most {longest:g}, {LONGEST:g} times the free fall from the top "
                f"of the column, got {r['t_end']:g}"
            )

    def _check_grid(self) -> None:
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
        needed, there = self.memory, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if needed > there:
            raise ConfigError(
                f"the simulation must fit into memory, got {needed / 2**30:.3g} GiB for "
                f"{self.cells} x {self.cells_y} cells and {self.frames} frames on a machine with "
                f"{there / 2**30:.3g} GiB: give fewer --cells or --frames, or a larger --stride"
            )

    @property
    def memory(self) -> float:
        """Bytes that the solver and the recorded frames take at most."""
        cells = self.cells * self.cells_y
        # u, v, p, c of a frame in float64, then all of them in float32 for the flow file.
        points = cells / self.stride**2
        return STATE_BYTES * cells + 4 * (8 + 4) * points * self.frames

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
        return replace(self, **self._resolved())

    def _resolved(self) -> dict[str, Any]:
        # Free fall from the top of the paper's column takes sqrt(2 x 10); scale by sqrt(H / g).
        g = math.hypot(*self.gravity)
        time = math.sqrt(self.height / PAPER_HEIGHT / g)
        stress_time = self.density * g * (self.height / PAPER_HEIGHT) * time
        air_viscosity = self.air_viscosity or PAPER_AIR_VISCOSITY * stress_time
        return {
            "box_width": self.box[0],
            "box_height": self.cells_y * self.spacing,
            "t_end": self.t_end or 5 * time,
            "eta_min": self.eta_min or air_viscosity,
            "eta_max": self.eta_max or PAPER_ETA_MAX * stress_time,
            "air_density": self.air_density or PAPER_AIR_DENSITY * self.density,
            "air_viscosity": air_viscosity,
            "wall_friction": self._wall_friction,
            "threads": self.threads or min(os.cpu_count() or 1, USUAL_THREADS),
        }

    @property
    def _wall_friction(self) -> float | None:
        stated = self.wall_friction
        return USUAL_WALLS.friction if stated is None and self.wall_gap is not None else stated

    @property
    def largest_step(self) -> float:
        g = math.hypot(*self.gravity)
        return PAPER_LARGEST_STEP * math.sqrt(self.height / PAPER_HEIGHT / g)


def law_settings(law: Law, theta: Sequence[float]) -> dict[str, Any]:
    """Keyword arguments of `Collapse` for this friction law with the parameters theta [N]."""
    return {"law": law.name, **dict(zip(law.names, theta, strict=True))}
