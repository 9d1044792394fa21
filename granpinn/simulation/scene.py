"""What all simulations have in common: the law, the grains, the air, the grid and the frames.

The fields are also the command line of ``python -m granpinn.simulate``. A field that is ``None``
takes the value of the paper's collapse, scaled to the units of this scene.
"""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import ConfigError, SideWalls, setting
from granpinn.config.fields import settings_of
from granpinn.physics.law_values import CompleteLaw

# The paper's column: 10 high and 1 wide under g = 1, with eta_max = 1e4 and air of 1e-4.
PAPER_HEIGHT = 10.0
PAPER_ETA_MAX = 1e4
PAPER_AIR_DENSITY = 1e-4
PAPER_AIR_VISCOSITY = 1e-4
PAPER_LARGEST_STEP = 1e-2
USUAL_SIDE_WALLS = SideWalls()

# Any unit of length, time and mass is possible. Products of sizes in this range are far from the
# largest and smallest float64.
SIZE: dict[str, float] = {"low": 1e-12, "high": 1e12}
VISCOSITY: dict[str, float] = {"low": 1e-30, "high": 1e30}
MOST_CELLS = 16384  # in a direction; the solver counts cells in 32 bits
LONGEST = 1000.0  # last time, in units of sqrt(2 height / |g|), the time of free fall
STATE_BYTES = 800  # of the solver for each cell
CELLS_MULTIPLE = 8
USUAL_THREADS = 4


@dataclass(frozen=True)
class Scene(CompleteLaw, ABC):
    """Grains that are released at t = 0: the base of `Collapse` and `Chute`.

    The first fields are the parameters of the friction law, such as mu_s, mu_2, I0, then `law`.

    Raises:
        ConfigError: the scene cannot be simulated; one sentence.
    """

    GRAINS = "grains"  # their name in messages
    PERIODIC = False  # whether the sides are; the surface then has one height in every column
    # Of the two solves: energy norm of the error, relative to that of one step of gravity.
    VISCOUS_TOLERANCE, PRESSURE_TOLERANCE = 1e-4, 1e-5

    d: float = setting(0.025, "grain diameter", **SIZE)
    cohesion: float = setting(0.0, "cohesive stress, added to the friction mu p", low=0, high=1e30)
    height: float = setting(10.0, "height of the column, or depth of the layer", **SIZE)
    density: float = setting(1.0, "bulk density of the grains", **SIZE)
    wall_gap: float | None = setting(
        None, "distance of side walls, whose friction slows the grains; none: no side walls", **SIZE
    )
    wall_friction: float | None = setting(
        None, f"friction of the side walls; none: {USUAL_SIDE_WALLS.friction}", low=0, high=2
    )
    t_end: float | None = setting(
        None,
        "last time; none: 5 for the paper's column, scaled; of a chute 2 (H/d) sqrt(H/g)",
        **SIZE,
    )
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
        own: type = type(self)
        for name, stated in settings_of(own).items():
            object.__setattr__(self, name, stated.check(getattr(self, name), name))
        try:
            super().__post_init__()
        except ValueError as error:
            raise ConfigError(str(error)) from None
        if self.wall_friction is not None and self.wall_gap is None:
            raise ConfigError("wall_friction needs the distance of the side walls: give wall_gap")
        self._set_cohesion()
        self._check()
        r = self._resolved()
        if not r["eta_min"] < r["eta_max"]:
            raise ConfigError(
                f"eta_min must be below eta_max = {r['eta_max']:g}, got {r['eta_min']:g}"
            )
        if r["t_end"] > self._longest:
            raise ConfigError(
                f"t_end must be at most {self._longest:g}, {LONGEST:g} times the free fall from "
                f"the top of the {self.GRAINS}, got {r['t_end']:g}"
            )

    def _set_cohesion(self) -> None:
        """The cohesion of a law that has one: as given, or typical in the units of the scene."""
        own = self.friction_law.cohesion
        if own is None:
            return
        if self.cohesion:
            raise ConfigError(
                f"the law {self.law} has the cohesion {own}: give {own} in the place of cohesion"
            )
        if own in self._missing:
            weight = self.density * math.hypot(*self.gravity) * self.height
            object.__setattr__(self, own, getattr(self, own) * weight)

    @abstractmethod
    def _check(self) -> None:
        """Raises ConfigError if the grains do not fit into the box or on the grid."""

    def _check_memory(self) -> None:
        needed, there = self.memory, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if needed > there:
            raise ConfigError(
                f"the simulation must fit into memory, got {needed / 2**30:.3g} GiB for "
                f"{self.cells_x} x {self.cells_y} cells and {self.frames} frames on a machine with "
                f"{there / 2**30:.3g} GiB: give fewer --cells or --frames, or a larger --stride"
            )

    @property
    @abstractmethod
    def gravity(self) -> tuple[float, float]:
        """Gravity in the axes of the box."""

    @property
    @abstractmethod
    def cells_x(self) -> int:
        """Cells across the width of the box."""

    @property
    @abstractmethod
    def cells_y(self) -> int:
        """Cells across the height of the box, a multiple of `chunk`."""

    @property
    @abstractmethod
    def spacing(self) -> float:
        """Cell size."""

    @property
    @abstractmethod
    def chunk(self) -> int:
        """Cells by which the window grows: a power of two that divides the box."""

    @abstractmethod
    def start_fraction(self) -> Float64:
        """Fraction of grains at the start, [cells_y, cells_x]."""

    @abstractmethod
    def shape_attributes(self) -> dict[str, float | None]:
        """The sizes of a resolved scene, for the attributes of its flow file."""

    @property
    def memory(self) -> float:
        """Bytes that the solver and the recorded frames take at most."""
        cells = self.cells_x * self.cells_y
        # u, v, p, c of a frame in float64, then all of them in float32 for the flow file.
        points = cells / self.stride**2
        return STATE_BYTES * cells + 4 * (8 + 4) * points * self.frames

    def resolved(self) -> Self:
        """The same scene with a number in the place of every ``None``."""
        return replace(self, **self._resolved())

    def _resolved(self) -> dict[str, Any]:
        # Free fall from the top of the paper's column takes sqrt(2 x 10); scale by sqrt(H / g).
        g = math.hypot(*self.gravity)
        time = math.sqrt(self.height / PAPER_HEIGHT / g)
        stress_time = self.density * g * (self.height / PAPER_HEIGHT) * time
        air_viscosity = self.air_viscosity or PAPER_AIR_VISCOSITY * stress_time
        usual = None if self.wall_gap is None else USUAL_SIDE_WALLS.friction
        return {
            "t_end": self.t_end or 5 * time,
            "eta_min": self.eta_min or air_viscosity,
            "eta_max": self.eta_max or PAPER_ETA_MAX * stress_time,
            "air_density": self.air_density or PAPER_AIR_DENSITY * self.density,
            "air_viscosity": air_viscosity,
            "wall_friction": usual if self.wall_friction is None else self.wall_friction,
            "threads": self.threads or min(os.cpu_count() or 1, USUAL_THREADS),
        }

    @property
    def _longest(self) -> float:
        """The largest last time."""
        return LONGEST * math.sqrt(2 * self.height / math.hypot(*self.gravity))

    @property
    def largest_step(self) -> float:
        g = math.hypot(*self.gravity)
        return PAPER_LARGEST_STEP * math.sqrt(self.height / PAPER_HEIGHT / g)


def filled(length: float, spacing: float, count: int) -> Float64:
    """Fractions of the cells between 0 and a length, [count]."""
    return np.clip((length - spacing * np.arange(count)) / spacing, 0.0, 1.0)


def chunk_of(cells: int) -> int:
    """Cells by which a window grows: a power of two that divides `cells`, a multiple of 8."""
    chunk = CELLS_MULTIPLE
    while cells % (2 * chunk) == 0 and 2 * chunk <= cells // 32:
        chunk *= 2
    return chunk
