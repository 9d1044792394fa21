"""Small problems for the bare solver: boxes of one fluid, and their exact solutions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn._collapse import Parameters, Side, Solver

Array = npt.NDArray[np.float64]
Function = Callable[[Array, Array], Array]


def zero(x: Array, y: Array) -> Array:
    return np.zeros(np.broadcast_shapes(x.shape, y.shape))


def one(x: Array, y: Array) -> Array:
    return np.ones(np.broadcast_shapes(x.shape, y.shape))


def parameters(cells_x: int, cells_y: int, spacing: float, **values: Any) -> Parameters:
    """The whole box as the window, no gravity, no air, Newtonian of viscosity 1 by default."""
    s = Parameters()
    defaults: dict[str, Any] = {
        "cells_x": cells_x,
        "cells_y": cells_y,
        "spacing": spacing,
        "margin": -1,
        "chunk": 8,
        "newtonian": True,
        "eta_max": 1.0,
        "eta_min": 0.0,
        "air_viscosity": 1e-4,
        "air_density": 1e-4,
        "law": "mu_of_i",
        "theta": (0.4, 0.64, 0.3),
        "grain_diameter": 0.025,
        "viscous_tolerance": 1e-10,
        "pressure_tolerance": 1e-10,
    }
    for name, value in {**defaults, **values}.items():
        setattr(s, name, value)
    return s


def incline(cells: int, tangent: float, **values: Any) -> Parameters:
    """A layer of depth 1 on a slope, periodic along it, without air; cells deep and 8 long."""
    cosine = 1 / np.sqrt(1 + tangent**2)
    layer: dict[str, Any] = {
        "newtonian": False,
        "eta_max": 1e4,
        "gravity_x": tangent * cosine,
        "gravity_y": -cosine,
        "left": Side.periodic,
        "right": Side.periodic,
        "air_density": 0.0,
        "largest_step": 1.0,
        "cfl": 1e3,  # nothing is advected: the flow is uniform along the slope
    }
    return parameters(8, cells, 1 / cells, **{**layer, **values})


def walls(side: Side) -> dict[str, Side]:
    return dict.fromkeys(("left", "right", "bottom", "top"), side)


def start(s: Parameters, c: Function = one, u: Function = zero, v: Function = zero) -> Solver:
    """A solver with fraction and velocity given as functions of x and y."""
    solver = Solver(s)
    x, y = centers(s)
    faces_x = s.spacing * np.arange(s.cells_x + 1)[None, :]
    faces_y = s.spacing * np.arange(s.cells_y + 1)[:, None]
    solver.set_state(c(x, y), u(faces_x, y), v(x, faces_y))
    return solver


def centers(s: Parameters) -> tuple[Array, Array]:
    """x [1, nx] and y [ny, 1] of cell centers."""
    h = s.spacing
    return h * (np.arange(s.cells_x)[None, :] + 0.5), h * (np.arange(s.cells_y)[:, None] + 0.5)


def run(solver: Solver, t_end: float, step: float) -> list[dict[str, Any]]:
    """Equal steps from the present time up to t_end; their reports."""
    reports = []
    for n in range(round(solver.time / step) + 1, round(t_end / step) + 1):
        while n * step - solver.time > 1e-12 * t_end:
            reports.append(solver.step(n * step - solver.time))
    return reports


def steady_from(s: Parameters, profile: Callable[[Array], Array]) -> dict[str, Array]:
    """The state after a long time of a layer on a slope, from a velocity u(y)."""
    solver = start(s, u=lambda x, y: profile(y) + 0 * x)
    run(solver, 600.0, 1.0)
    state: dict[str, Array] = solver.state()
    return state


def dissipation(s: Parameters, state: dict[str, Array]) -> float:
    """The integral of 2 eta D:D on floor and sides without slip; none on open sides."""
    u, v, eta = state["u"], state["v"], state["eta_center"]
    normal = np.diff(u, axis=1) ** 2 + np.diff(v, axis=0) ** 2
    # A gradient over half a cell in half a cell of a wall: 2.
    shear = np.diff(np.pad(u, ((1, 1), (0, 0))), axis=0) + np.diff(np.pad(v, ((0, 0), (1, 1))))
    share = np.ones_like(shear)
    share[0, 1:-1] = 2
    share[-1] = 0  # open
    for side, at in ((s.left, 0), (s.right, -1)):
        share[:, at] *= 2 if side == Side.no_slip else 0
    share[0, [0, -1]] = 0
    share[-1, :] = 0
    return float((2 * eta * normal).sum() + (state["eta_corner"] * share * shear**2).sum())


def relative(found: Array, exact: Array) -> float:
    """The relative error of a field [ny, nx]; `exact` may be [ny, 1]."""
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact + 0 * found))


def order(errors: list[float]) -> float:
    """Slope of the last two errors under halving of the cell size or the step."""
    return float(np.log2(errors[-2] / errors[-1]))
