"""Gate V-2 on flows with exact solutions: rest, Poiseuille, Taylor and Green.

The scheme is designed to be of second order in space and, because the viscous step is implicit
Euler with the viscosity of the step before, of first order in time.
"""

import numpy as np
import pytest

from granpinn._collapse import Side
from tests.simulation import problems as p


def test_column_at_rest_carries_its_weight() -> None:
    """Grains that fill the width of the box, air above: v = 0 and p = rho g depth."""
    h, height = 1 / 32, 1.5
    s = p.parameters(32, 64, h, newtonian=False, eta_max=1e4, gravity_y=-1.0)
    solver = p.start(s, c=lambda x, y: (y < height) * np.ones_like(x))
    reports = p.run(solver, 0.2, 0.02)
    state = solver.state()
    _, y = p.centers(s)
    # The air is lighter by 1e-4: p = rho g (height - y) + rho_air g (2 - height) below the surface.
    exact = np.where(y < height, height - y + 1e-4 * (2 - height), 1e-4 * (2 - y))
    assert max(r["largest_speed"] for r in reports) < 1e-8
    # c = 0 / 1 exactly at a face: the only face of mixed density is the surface itself, where the
    # arithmetic mean puts the jump of the gradient in the middle.
    np.testing.assert_allclose(state["p"], exact + 0 * state["p"], atol=1e-8)


def poiseuille_error(cells: int) -> float:
    """Flow between two walls, driven by g_x = 1: u = y (1 - y)/2 when steady."""
    s = p.parameters(8, cells, 1 / cells, gravity_x=1.0, air_density=0.0)
    s.left = s.right = Side.periodic
    s.top = Side.no_slip
    solver = p.start(s)
    p.run(solver, 2.0, 0.01)  # the slowest transient has decayed to e^(-2 pi^2)
    _, y = p.centers(s)
    return float(np.abs(solver.state()["u"] - 0.5 * y * (1 - y)).max())


def test_poiseuille_flow_is_of_second_order() -> None:
    errors = [poiseuille_error(n) for n in (16, 32, 64)]
    assert errors[-1] < 1e-4
    assert p.order(errors) == pytest.approx(2, abs=0.1)


def taylor_green_errors(cells: int, step: float, t_end: float = 0.25) -> tuple[float, float]:
    """u = sin x cos y e^(-2 nu t), v = -cos x sin y e^(-2 nu t) between free-slip walls."""
    nu = 1.0
    s = p.parameters(cells, cells, np.pi / cells, eta_max=nu, **p.walls(Side.free_slip))
    solver = p.start(s, u=lambda x, y: np.sin(x) * np.cos(y), v=lambda x, y: -np.cos(x) * np.sin(y))
    p.run(solver, t_end, step)
    state = solver.state()
    decay = np.exp(-2 * nu * t_end)
    x, y = p.centers(s)
    faces = s.spacing * np.arange(cells + 1)[None, :]
    velocity = np.sqrt(np.mean((state["u"] - decay * np.sin(faces) * np.cos(y)) ** 2))
    exact = 0.25 * decay**2 * (np.cos(2 * x) + np.cos(2 * y))
    pressure = np.sqrt(np.mean((state["p"] - state["p"].mean() - exact) ** 2))
    return float(velocity), float(pressure)


def test_taylor_green_vortex_is_of_second_order_in_space() -> None:
    """The step shrinks with the square of the cell size, so that both errors fall alike."""
    errors = [taylor_green_errors(n, 0.25 / (n // 4) ** 2) for n in (16, 32, 64)]
    velocity, pressure = ([e[k] for e in errors] for k in (0, 1))
    assert velocity[-1] < 1e-3
    for found in (velocity, pressure):
        assert p.order(found) == pytest.approx(2, abs=0.1)


def test_taylor_green_vortex_is_of_first_order_in_time() -> None:
    """Differences between successive steps, on one grid: its own error drops out."""
    values = [taylor_green_errors(32, 0.25 / n)[0] for n in (16, 32, 64, 128)]
    differences = np.abs(np.diff(values)).tolist()
    assert p.order(differences) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("number", [1e0, 1e3, 1e6])
def test_viscous_step_is_stable_at_any_diffusion_number(number: float) -> None:
    """eta dt / (rho h^2) up to 1e6: energy never grows, and the solves converge."""
    cells, step = 32, 0.01
    s = p.parameters(cells, cells, 1 / cells, eta_max=number / step / cells**2)
    for name in ("left", "right", "bottom"):
        setattr(s, name, Side.no_slip)
    rng = np.random.default_rng(5)
    noise = {k: rng.standard_normal((cells + 1, cells + 1)) for k in "uv"}
    solver = p.start(
        s,
        u=lambda x, y: 0.1 * noise["u"][: y.size, : x.size] * (x * (1 - x) > 1e-9),
        v=lambda x, y: 0.1 * noise["v"][: y.size, : x.size] * (y > 1e-9),
    )
    energy = []
    for _ in range(10):
        solver.step(step)
        state = solver.state()
        energy.append(float((state["u"] ** 2).sum() + (state["v"] ** 2).sum()))
    assert np.isfinite(energy).all()
    assert (np.diff(energy) <= 1e-12).all()
