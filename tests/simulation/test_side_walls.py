"""Friction of side walls in the simulator, on flows with closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn._collapse import Side
from tests.simulation import problems as p

WALL = 0.2  # k = 2 mu_w / W


def stopping_error(step: float) -> float:
    """Relative error of the distance over which sheets of a layer slide until they stop.

    Nearly without viscosity every sheet is free, at the depth z under the pressure g z: it stops
    after u_0^2 / (2 k g z).
    """
    cells, u_0 = 16, 0.5
    s = p.parameters(
        8,
        cells,
        1 / cells,
        eta_max=1e-12,
        gravity_y=-1.0,
        left=Side.periodic,
        right=Side.periodic,
        bottom=Side.free_slip,
        air_density=0.0,
        side_wall=WALL,
        side_wall_speed=1e-5,
        cfl=1e3,  # nothing is advected: the flow is uniform along the layer
        largest_step=step,
    )
    _, y = p.centers(s)
    solver = p.start(s, u=lambda x, y: u_0 + 0 * x + 0 * y)
    distance = np.zeros(cells)
    lowest = u_0 / (WALL * 0.5)  # when the sheet at half the depth has stopped
    while solver.time < 1.2 * lowest - step / 2:
        before = solver.state()["u"][:, 0]
        solver.step(step)
        distance += step * (before + solver.state()["u"][:, 0]) / 2
    state = solver.state()
    np.testing.assert_allclose(state["p"], 1 - y + 0 * state["p"], atol=1e-9)
    deep = (1 - y[:, 0]) > 0.5
    assert np.abs(state["u"][deep]).max() < 1e-3 * u_0
    exact = u_0**2 / (2 * WALL * (1 - y[:, 0]))
    return float(np.abs(distance / exact - 1)[deep].max())


def test_sheets_stop_at_the_distance_of_their_pressure() -> None:
    errors = [stopping_error(step) for step in (0.04, 0.02, 0.01)]
    assert errors[-1] < 0.02
    assert p.order(errors) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("fraction", [1.0, 0.5])
def test_side_walls_take_the_power_of_the_whole_velocity(fraction: float) -> None:
    """A slow roll in a box under its weight: they take c k p |v| of it, |v|^2 = u^2 + v^2."""
    s = p.parameters(32, 32, 1 / 32, eta_max=1e-12, air_density=0.0, gravity_y=-1.0)
    s.left = s.right = s.bottom = Side.free_slip
    s.side_wall, s.side_wall_speed, s.largest_step = WALL, 1e-6, 1e-3
    solver = p.start(
        s,
        c=lambda x, y: fraction * p.one(x, y),
        u=lambda x, y: 0.05 * np.sin(np.pi * x) * np.cos(np.pi * y),
        v=lambda x, y: -0.05 * np.cos(np.pi * x) * np.sin(np.pi * y),
    )
    p.run(solver, 1e-3, 1e-3)  # the first step has no pressure, and so no friction
    before = solver.state()
    p.run(solver, 2e-3, 1e-3)
    after = solver.state()
    energy = [(np.sum(a["u"] ** 2) + np.sum(a["v"] ** 2)) / 2 for a in (before, after)]
    u, v = before["u"], before["v"]  # on faces
    speed = np.hypot(u[:, 1:] + u[:, :-1], v[1:] + v[:-1]) / 2
    power = WALL * np.sum(before["p"] * speed)
    assert before["p"].max() == pytest.approx(fraction, rel=0.02)
    lost = fraction * (energy[0] - energy[1]) / 1e-3
    assert lost == pytest.approx(fraction * power, rel=0.02)
