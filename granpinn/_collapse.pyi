"""Types of the compiled column-collapse solver (csrc/collapse/module.cpp)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

class Side:
    no_slip: Side
    free_slip: Side
    open: Side
    periodic: Side

class Parameters:
    cells_x: int
    cells_y: int
    spacing: float
    left: Side
    right: Side
    bottom: Side
    top: Side
    law: str  # setting it clears theta
    theta: Sequence[float]
    grain_diameter: float
    cohesion: float
    eta_min: float
    eta_max: float
    density: float
    air_density: float
    air_viscosity: float
    gravity_x: float
    gravity_y: float
    newtonian: bool
    chunk: int
    margin: int
    cfl: float
    largest_step: float
    viscous_tolerance: float
    pressure_tolerance: float
    largest_iteration_count: int
    threads: int

class Solver:
    time: float
    def __init__(self, parameters: Parameters) -> None: ...
    def set_state(self, c: Array, u: Array, v: Array) -> None: ...
    def step(self, largest: float, count: int = 1) -> dict[str, Any]: ...
    def advect_fraction(self, step: float) -> None: ...
    def state(self) -> dict[str, Array]: ...
