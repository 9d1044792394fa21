"""The compiled solver as a Python object: NumPy arrays in and out, one step at a time.

    engine = Engine(Collapse(mu_s=0.4, mu_2=0.64, cells=128))
    while engine.time < 1:
        engine.step(1 - engine.time)

csrc/collapse/ describes the numerical method.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn import _collapse
from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.physics.constants import side_wall
from granpinn.simulation.scene import Scene

MARGIN = 8  # cells of air around the grains
SLOWEST_ON_WALLS = 1e-4  # of sqrt(|g| height): below it, grains creep along side walls


class SimulationError(CannotGoOn):
    """A solve did not converge; the message has its iterations and its error."""


@dataclass(frozen=True)
class StepReport:
    """Report of one time step.

    Attributes:
        time, step: time at the end of the step, and its length.
        viscous_iterations, pressure_iterations: of the two solves.
        largest_divergence: largest volume error of a cell, relative.
        window: cells that were computed, (x, y).
    """

    time: float
    step: float
    viscous_iterations: int
    pressure_iterations: int
    largest_divergence: float
    window: tuple[int, int]

    @property
    def words(self) -> str:
        """The line for the terminal, without the time."""
        return (
            f"dt {self.step:.2g}  iterations {self.viscous_iterations}+{self.pressure_iterations}  "
            f"window {self.window[0]}x{self.window[1]}"
        )


@dataclass(frozen=True, eq=False)
class State:
    """Fields on the window of ny x nx cells, from the lower left corner of the box.

    Attributes:
        c, p: fraction of grains and pressure at cell centers [ny, nx].
        u: velocity through the vertical faces [ny, nx + 1]; v: through the horizontal [ny + 1, nx].
        eta_center, eta_corner: viscosity of the last step [ny, nx], [ny + 1, nx + 1].
    """

    c: Float64
    p: Float64
    u: Float64
    v: Float64
    eta_center: Float64
    eta_corner: Float64

    @property
    def u_center(self) -> Float64:
        mean: Float64 = 0.5 * (self.u[:, 1:] + self.u[:, :-1])
        return mean

    @property
    def v_center(self) -> Float64:
        mean: Float64 = 0.5 * (self.v[1:] + self.v[:-1])
        return mean


class Engine:
    """A simulation in progress: grains in air at a time."""

    def __init__(self, scene: Scene, **overrides: Any) -> None:
        """Makes a simulation at t = 0, with the grains of the scene at rest.

        Args:
            overrides: fields of `_collapse.Parameters`, for tests.
        """
        self.scene = scene.resolved()
        self.spacing = self.scene.spacing
        parameters = solver_parameters(self.scene)
        for name, value in overrides.items():
            setattr(parameters, name, value)
        with _named_errors():
            self._solver = _collapse.Solver(parameters)
        nx, ny = parameters.cells_x, parameters.cells_y
        rest = np.zeros((ny, nx + 1)), np.zeros((ny + 1, nx))
        with _named_errors():
            self._solver.set_state(self.scene.start_fraction(), *rest)

    @property
    def time(self) -> float:
        return float(self._solver.time)

    def step(self, largest: float, count: int = 1) -> StepReport:
        """A time step: the longest stable one that divides the time `largest`; the last of
        `count` such steps."""
        with _named_errors():
            report = self._solver.step(largest, count)
        return StepReport(**{name: report[name] for name in StepReport.__dataclass_fields__})

    def state(self) -> State:
        return State(**self._solver.state())


@contextmanager
def _named_errors() -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        raise SimulationError(str(error)) from None


def solver_parameters(scene: Scene) -> _collapse.Parameters:
    """The parameters of the compiled solver for a resolved scene."""
    parameters = _collapse.Parameters()
    values = {
        "law": scene.law,
        "theta": scene.theta,
        "grain_diameter": scene.d,
        "gravity_x": scene.gravity[0],
        "gravity_y": scene.gravity[1],
        "margin": MARGIN,
        "viscous_tolerance": scene.VISCOUS_TOLERANCE,
        "pressure_tolerance": scene.PRESSURE_TOLERANCE,
    }
    sides = ("periodic", "periodic") if scene.PERIODIC else ("free_slip", "no_slip")
    values["left"], values["right"] = (getattr(_collapse.Side, side) for side in sides)
    same = ("cohesion", "eta_min", "eta_max", "density", "air_density", "air_viscosity")
    grid = ("cells_x", "cells_y", "spacing", "chunk", "largest_step")
    for name in (*same, *grid, "cfl", "threads"):
        values[name] = getattr(scene, name)
    if scene.wall_gap is not None:
        assert scene.wall_friction is not None  # resolved
        values["side_wall"] = side_wall(scene.wall_friction, scene.wall_gap)
        fall = math.sqrt(math.hypot(*scene.gravity) * scene.height)
        values["side_wall_speed"] = SLOWEST_ON_WALLS * fall
    for name, value in values.items():
        setattr(parameters, name, value)
    return parameters
