"""A whole collapse: mass, energy, the window, threads, iteration counts, regimes, cohesion."""

import numpy as np
import pytest

from granpinn.simulation import Collapse, Engine, State, StepReport
from granpinn.simulation.engine import solver_parameters
from tests.simulation.problems import dissipation

# (mu_s, mu_2) of mu(I) in the six regimes of the paper's figure 3.
PAPER_CASES = ((0.2, 0.32), (0.2, 0.44), (0.4, 0.52), (0.4, 0.64), (0.6, 0.72), (0.6, 0.84))


def advance(engine: Engine, t_end: float) -> list[StepReport]:
    reports = []
    while t_end - engine.time > 1e-9:
        reports.append(engine.step(t_end - engine.time))
    return reports


def small(**settings: object) -> Collapse:
    """A column of aspect ratio 2: 1 wide, 2 high, in a box 6 wide."""
    values = {"mu_s": 0.4, "mu_2": 0.64, "height": 2.0, "aspect": 2.0, "box_width": 6.0}
    return Collapse(**{**values, "cells": 96, "threads": 1, **settings})  # type: ignore[arg-type]


def test_mass_is_conserved_to_1e_6() -> None:
    engine = Engine(small())
    before = engine.state().c.sum()
    reports = advance(engine, 4.0)
    assert engine.state().c.sum() == pytest.approx(before, rel=1e-6)
    assert max(r.largest_divergence for r in reports) < 1e-4


def energies(state: State, h: float) -> tuple[float, float]:
    """Kinetic and potential energy of the grains, density 1, g = 1."""
    c, y = state.c, h * (np.arange(state.c.shape[0]) + 0.5)
    c_u = 0.5 * (np.pad(c, ((0, 0), (1, 0))) + np.pad(c, ((0, 0), (0, 1))))
    c_v = 0.5 * (np.pad(c, ((1, 0), (0, 0))) + np.pad(c, ((0, 1), (0, 0))))
    kinetic = 0.5 * float((c_u * state.u**2).sum() + (c_v * state.v**2).sum())
    return h**2 * kinetic, h**2 * float((c * y[:, None]).sum())


def test_energy_is_lost_to_friction() -> None:
    """d(KE + PE)/dt = - integral of mu p gamma_dot, to 2 % of what is lost."""
    scene = small(cells=192).resolved()
    engine, s, h = Engine(scene), solver_parameters(scene), scene.spacing
    start = sum(energies(engine.state(), h))
    lost = 0.0
    while engine.time < 3.0:
        report = engine.step(0.01)
        lost += report.step * dissipation(s, vars(engine.state()))
    end = sum(energies(engine.state(), h))
    assert start - end == pytest.approx(lost, rel=0.02)


def test_window_does_not_change_the_grains() -> None:
    """A margin four times as wide, or the whole box: the same flow of grains."""
    states = []
    for overrides in ({}, {"margin": 32}, {"margin": -1}):
        engine = Engine(small(), **overrides)
        advance(engine, 2.0)
        states.append(engine.state())
    narrow, wide, whole = states
    assert narrow.c.size < 0.6 * whole.c.size
    for other in (wide, whole):
        ny, nx = np.minimum(narrow.c.shape, other.c.shape)
        grains = (narrow.c[:ny, :nx] == 1) & (other.c[:ny, :nx] == 1)
        difference = (narrow.u_center[:ny, :nx] - other.u_center[:ny, :nx])[grains]
        assert np.linalg.norm(difference) < 0.01 * np.linalg.norm(other.u_center[:ny, :nx][grains])


def test_velocities_at_centers_are_means_of_two_faces() -> None:
    u = np.array([[0.0, 2.0, 6.0], [1.0, 1.0, -3.0]])  # faces x = 0, 1, 2 of 2 x 2 cells
    v = np.array([[0.0, 4.0], [2.0, 8.0], [5.0, -2.0]])  # faces y = 0, 1, 2
    cells, corners = np.ones((2, 2)), np.ones((3, 3))
    state = State(c=cells, p=cells, u=u, v=v, eta_center=cells, eta_corner=corners)
    np.testing.assert_array_equal(state.u_center, [[1, 4], [1, -1]])
    np.testing.assert_array_equal(state.v_center, [[1, 6], [3.5, 3]])


def test_threads_give_the_same_bits() -> None:
    """On a grid that is large enough for its loops to be shared."""
    states = []
    for threads in (1, 3):
        engine = Engine(small(cells=384, threads=threads))
        advance(engine, 0.1)
        states.append(engine.state())
    for name in ("c", "p", "u", "v"):
        np.testing.assert_array_equal(getattr(states[0], name), getattr(states[1], name))


def test_iterations_do_not_grow_with_the_grid() -> None:
    counts = []
    for cells in (96, 192, 384):
        reports = advance(Engine(small(cells=cells)), 0.4)
        counts.append(
            (
                float(np.mean([r.viscous_iterations for r in reports])),
                float(np.mean([r.pressure_iterations for r in reports])),
            )
        )
    assert max(c[0] for c in counts) < 10
    assert max(c[1] for c in counts) < 10
    assert counts[2][0] < 1.5 * counts[0][0] + 1
    assert counts[2][1] < 1.5 * counts[0][1] + 1


@pytest.mark.parametrize(("mu_s", "mu_2"), PAPER_CASES)
def test_paper_cases_run(mu_s: float, mu_2: float) -> None:
    """All six regimes on a coarse grid; more friction, less far."""
    engine = Engine(Collapse(mu_s=mu_s, mu_2=mu_2, cells=64, threads=1))
    advance(engine, 5.0)
    front = np.flatnonzero((engine.state().c > 0.5).any(axis=0)).max() * engine.spacing
    assert 5.5 < front < 10.5


def test_cohesion_holds_grains_back() -> None:
    reach = []
    for cohesion in (0.0, 0.1):
        engine = Engine(small(cohesion=cohesion))
        advance(engine, 3.0)
        reach.append(np.flatnonzero((engine.state().c > 0.5).any(axis=0)).max())
    assert reach[1] < reach[0]


def test_units_do_not_matter() -> None:
    """The same column in meters, seconds and kilograms: the same motion in scaled time."""
    plain = Engine(small())
    advance(plain, 1.0)
    length, g, density = 0.05, 9.81, 1550.0
    si = Engine(
        small(
            height=2 * length,
            box_width=6 * length,
            d=0.025 * length,
            gravity=(0.0, -g),
            density=density,
        )
    )
    advance(si, np.sqrt(length / g))
    speed = np.sqrt(g * length)
    a, b = plain.state(), si.state()
    assert a.c.shape == b.c.shape
    assert np.abs(a.u - b.u / speed).max() < 0.05 * np.abs(a.u).max()
    grains = (a.c == 1) & (b.c == 1)
    scaled = b.p[grains] / (density * g * length)
    assert np.linalg.norm(a.p[grains] - scaled) < 0.01 * np.linalg.norm(a.p[grains])
