"""An opening in the floor: fall, mass, energy, symmetry, refinement, and air that comes in.

A box of the bare solver with an opening at any cells. The flow through a part of the floor is
singular at the ends of the opening, so it converges with the first power of the cell size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from granpinn._collapse import Parameters, Side, Solver
from tests.simulation import problems as p

AIR = 1e-6  # density and viscosity, of those of the grains


def box(cells: int, opening: tuple[int, int], rows: int = 1, **values: Any) -> Parameters:
    """A box 1 wide and `rows` high under g = 1; the sides are like the floor, without slip."""
    defaults = {"left": Side.no_slip, "gravity_y": -1.0, "largest_step": 0.02}
    defaults |= {"open_from": opening[0], "open_to": opening[1]}
    return p.parameters(cells, rows * cells, 1 / cells, **{**defaults, **values})


def to_height(height: float) -> p.Function:
    return lambda x, y: (y < height) * np.ones_like(x)


def volume(s: Parameters, solver: Solver) -> float:
    return float(solver.state()["c"].sum()) * s.spacing**2


def middle(cells: int) -> tuple[int, int]:
    """A quarter of the floor."""
    return 3 * cells // 8, 5 * cells // 8


@pytest.mark.parametrize("margin", [-1, 4])
def test_column_on_nothing_falls_freely(margin: int) -> None:
    """All of the floor is open, the sides are smooth: v = -g t, and g t^2 / 2 has left.

    Air is carried along and lifts the grains, both by 1e-6 at most as long as half of the grains
    are there. The first step has the velocity of its start, 0, so the fall is dt^2 / 2 behind.
    """
    cells, height, step = 16, 1.5, 0.01
    smooth = {"left": Side.free_slip, "right": Side.free_slip, "margin": margin}
    air = {"air_density": AIR, "air_viscosity": AIR}
    s = box(cells, (0, cells), 2, eta_max=1e-2, largest_step=step, **smooth, **air)
    solver = p.start(s, c=to_height(height))
    left = sum(report["outflow"] for report in p.run(solver, 1.0, step))
    state = solver.state()
    np.testing.assert_allclose(state["v"], -1.0, rtol=0, atol=3 * AIR)
    assert np.abs(state["u"]).max() < AIR
    assert left == pytest.approx(0.5 - step**2 / 2, abs=1e-6)
    assert volume(s, solver) == pytest.approx(height - left, rel=1e-8)
    p.run(solver, 2.0, step)  # everything leaves, and the box of air goes on
    assert volume(s, solver) == 0


@pytest.mark.parametrize("newtonian", [True, False])
def test_mass_leaves_at_the_rate_of_the_flux_through_the_opening(newtonian: bool) -> None:
    """The velocity on the faces of the opening, extrapolated to the middle of a step."""
    cells, opening = 32, (9, 20)
    tight = {"pressure_tolerance": 1e-13, "viscous_tolerance": 1e-9}
    s = box(cells, opening, 2, newtonian=newtonian, eta_max=0.1 if newtonian else 1e3, **tight)
    solver = p.start(s, c=to_height(1.5))
    faces = [solver.state()["v"][0]]
    steps, flux, left = [0.0], 0.0, 0.0
    before = volume(s, solver)
    for _ in range(40):
        report = solver.step(0.01)
        share = 0.5 * report["step"] / steps[-1] if steps[-1] else 0.0
        half = faces[-1] + share * (faces[-1] - faces[-2] if len(faces) > 1 else 0.0)
        flux -= float(half.sum()) * s.spacing * report["step"]
        left += report["outflow"]
        faces.append(solver.state()["v"][0])
        steps.append(report["step"])
    assert left > 0.01
    assert left == pytest.approx(flux, rel=1e-10)
    assert before - volume(s, solver) == pytest.approx(left, rel=1e-10)
    assert not faces[-1][: opening[0]].any()
    assert not faces[-1][opening[1] :].any()


def through_orifice(cells: int, eta: float, **values: Any) -> tuple[Parameters, Solver]:
    """A box full of liquid, open above and in the middle of its floor, until the flow is steady."""
    s = box(cells, middle(cells), eta_max=eta, air_density=0.0, **values)
    solver = p.start(s)
    p.run(solver, 1.0 / eta if eta > 1 else 1.0, 0.02 / max(eta, 1.0))
    return s, solver


def test_flow_through_an_orifice_converges() -> None:
    found = []
    for cells in (16, 32, 64):
        s, solver = through_orifice(cells, 1.0)
        state = solver.state()
        found.append(-float(state["v"][0].sum()) * s.spacing)
        assert -state["v"][-1].sum() * s.spacing == pytest.approx(found[-1], rel=1e-6)
    assert p.order(np.diff(found).tolist()) == pytest.approx(1, abs=0.1)
    assert abs(found[2] - found[1]) < 0.05 * found[2]


def test_weight_of_a_slow_liquid_is_lost_to_friction() -> None:
    """Steady and without inertia: gravity g on the momentum of all faces = dissipation.

    The inertia is a Reynolds number, the velocity of 6e-4 times the width of 0.25 over eta = 10.
    """
    s, solver = through_orifice(32, 10.0, pressure_tolerance=1e-12, viscous_tolerance=1e-12)
    state = solver.state()
    v = state["v"].copy()
    v[[0, -1]] *= 0.5  # half a cell of liquid at open sides
    work = -float(v.sum()) * s.spacing**2
    assert p.dissipation(s, state) == pytest.approx(work, rel=1e-4)


def test_what_comes_in_through_an_opening_is_air() -> None:
    """Gravity upward: the grains rise as a block, and their volume stays."""
    cells, height = 16, 0.5
    smooth = {"left": Side.free_slip, "right": Side.free_slip, "gravity_y": 1.0}
    s = box(cells, (0, cells), 2, eta_max=1.0, **smooth)
    solver = p.start(s, c=to_height(height))
    reports = p.run(solver, 1.0, 0.01)
    state = solver.state()
    assert volume(s, solver) == pytest.approx(height, rel=1e-6)  # the gate of a collapse
    assert sum(r["outflow"] for r in reports) == 0
    assert state["c"][: cells // 4].max() == 0  # risen by 1/2
    assert state["v"].min() == pytest.approx(1, rel=1e-3)
