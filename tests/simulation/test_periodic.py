"""Periodic sides: a flow that is moved along x moves as before, across every side."""

import numpy as np

from granpinn._collapse import Side, Solver
from tests.simulation import problems as p

CELLS, MOVED = 32, 5


def bumpy_layer(moved: int) -> Solver:
    """A layer with a wave on its surface, which slides down a slope for 40 steps."""
    h = 1 / 16
    s = p.parameters(
        CELLS,
        32,
        h,
        newtonian=False,
        eta_max=1e3,
        grain_diameter=0.05,
        gravity_x=0.4,
        gravity_y=-0.9,
        left=Side.periodic,
        right=Side.periodic,
        largest_step=0.01,
        viscous_tolerance=1e-9,
        pressure_tolerance=1e-9,
    )

    def fraction(x: p.Array, y: p.Array) -> p.Array:
        surface = 1 + 0.2 * np.sin(2 * np.pi * (x / h - moved) / CELLS)
        return np.clip((surface - y) / h + 0.5, 0, 1)

    solver = p.start(s, c=fraction)
    p.run(solver, 0.4, 0.01)
    return solver


def test_flow_that_is_moved_along_x_moves_as_before() -> None:
    here, there = bumpy_layer(0).state(), bumpy_layer(MOVED).state()
    # The solves stop at an error of 1e-9 of one step. The pressure has up to eta_max x strain rate.
    allowed = {"c": 1e-7, "u": 1e-7, "v": 1e-7, "eta_center": 1e-5, "eta_corner": 1e-5, "p": 1e-3}
    for name, error in allowed.items():
        a, b = here[name][:, :CELLS], there[name][:, :CELLS]
        assert np.ptp(a) > 0.1
        np.testing.assert_allclose(
            np.roll(a, MOVED, axis=1), b, rtol=0, atol=error * np.abs(a).max(), err_msg=name
        )
