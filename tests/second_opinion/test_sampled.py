"""Simulations that are sampled as a measured flow was: frames, grid, mask, surface line."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.data import Flow, check_flow
from granpinn.data.flow import Particles, Surface
from granpinn.data.particles import particle_flow
from granpinn.physics.laws import DEFAULT
from granpinn.second_opinion.comparison import interpolation
from granpinn.second_opinion.sampled import Sampler, crossings
from granpinn.second_opinion.scenes import scene_of
from granpinn.simulation import Collapse, simulate
from granpinn.simulation.progress import SilentSimulation
from granpinn.simulation.run import record

LAW = (0.4, 0.64, 0.3)

CONSTANTS = ("gravity", "density", "grain_diameter", "length_unit", "time_unit", "walls")


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(*LAW, cells=64, stride=2, frames=12, t_end=3.0, threads=1))


def again(flow: Flow, law: tuple[float, ...] = LAW, cells: int | None = None) -> Flow:
    """The scene of a flow, simulated and sampled as the flow."""
    posed = scene_of(flow, DEFAULT, law, cells)
    assert not isinstance(posed, str)
    sampler = Sampler(posed[0], flow)
    record(sampler, SilentSimulation(), flow.t.tolist())
    made = sampler.flow()
    check_flow(made)
    return made


def same_points(a: Surface | None, b: Surface | None) -> float:
    """The largest distance of two lines with the same times."""
    assert a is not None
    assert b is not None
    np.testing.assert_allclose(a.t, b.t, rtol=1e-12)
    return float(np.hypot(a.x - b.x, a.y - b.y).max())


def test_the_true_law_gives_the_vectors_back_to_the_bit(flow: Flow) -> None:
    made = again(flow)
    for name in ("t", "x", "y", "u", "v", "c"):
        np.testing.assert_array_equal(getattr(made, name), getattr(flow, name))
    assert [getattr(made, name) for name in CONSTANTS] == [
        getattr(flow, name) for name in CONSTANTS
    ]
    assert (made.p, made.path, made.sha256) == (None, None, "")
    assert made.truth == flow.truth
    assert made.attributes == flow.attributes | {"surface_sd": 0.0}
    # Cells with |c - 1/2| < 0.1 are next to the place where c falls through 1/2.
    cell = float(flow.attributes["grid_spacing_of_solver"])
    assert 0 < same_points(made.surface, flow.surface) < 0.5 * cell


def test_a_vector_is_where_the_data_have_one_and_the_simulation_has_grains(flow: Flow) -> None:
    u, v = flow.u.copy(), flow.v.copy()
    for field in (u, v):
        field[:, 3, 1] = field[4, :5] = np.nan
    gaps = dataclasses.replace(flow, u=u, v=v)
    other = (0.3, 0.5, 0.3)
    made, whole = again(gaps, other), again(flow, other)
    np.testing.assert_array_equal(made.valid, whole.material & gaps.valid)
    assert made.valid.sum() < gaps.valid.sum()
    np.testing.assert_array_equal(made.c, whole.c)
    free = simulate(Collapse(*other, cells=64, stride=2, frames=12, t_end=3.0, threads=1))
    ny, nx = (min(a, b) for a, b in zip(free.c.shape[1:], flow.c.shape[1:], strict=True))
    both = made.valid[:, :ny, :nx]
    np.testing.assert_array_equal(made.u[:, :ny, :nx][both], free.u[:, :ny, :nx][both], strict=True)


def test_another_grid_and_a_mask(flow: Flow) -> None:
    """Vectors of a camera: between the cells of the simulation, and c is 0 or 1."""
    x, y = flow.x[:-1] + 0.07, flow.y[:-1] + 0.03
    at = interpolation(flow, dataclasses.replace(flow, x=x, y=y))
    u, v = (np.stack([at(f) for f in field]).astype(np.float32) for field in (flow.u, flow.v))
    c = np.isfinite(u).astype(np.float32)
    box = {k: a for k, a in flow.attributes.items() if k != "grid_spacing_of_solver"}
    seen = dataclasses.replace(flow, x=x, y=y, u=u, v=v, c=c, p=None, attributes=box)
    made = again(seen, cells=64)
    assert set(np.unique(made.c)) == {0.0, 1.0}
    exact = simulate(  # the column as measured on this grid, all cells
        dataclasses.replace(_scene(seen), stride=1, frames=12, threads=1)
    )
    at = interpolation(exact, seen)
    expected = np.stack([at(f) for f in exact.u])
    inside = x[None, :] >= exact.x[0]
    known = made.valid & inside & np.isfinite(expected)
    assert known.sum() > 0.9 * seen.valid.sum()
    np.testing.assert_allclose(made.u[known], expected[known], atol=1e-6)
    np.testing.assert_array_equal(made.valid, made.valid & seen.valid)


def _scene(flow: Flow) -> Collapse:
    posed = scene_of(flow, DEFAULT, LAW, 64)
    assert not isinstance(posed, str)
    assert isinstance(posed[0], Collapse)
    return posed[0]


def test_scattered_vectors_stay_where_they_are(flow: Flow) -> None:
    k, j, i = np.nonzero(flow.valid & (np.arange(12) > 0)[:, None, None])
    n = len(k)
    vectors = Particles(
        flow.t[k], flow.x[i], flow.y[j], flow.u[k, j, i], flow.v[k, j, i],
        np.full(n, 0.1, np.float32), np.full(n, 0.2, np.float32),
    )  # fmt: skip
    others = {name: getattr(flow, name) for name in (*CONSTANTS, "attributes", "surface")}
    tracks = particle_flow(vectors, **others)
    scene = Collapse(*LAW, cells=64, stride=2, frames=12, t_end=3.0, threads=1)
    sampler = Sampler(scene, tracks)
    record(sampler, SilentSimulation(), tracks.t.tolist())
    made = sampler.flow().particles
    assert made is not None
    for name, values in vars(vectors).items():
        np.testing.assert_allclose(getattr(made, name), values, atol=1e-6)


def test_measured_pressure_on_the_line_is_simulated(flow: Flow) -> None:
    assert flow.surface is not None
    assert flow.surface.p is not None
    surface = again(flow).surface
    assert surface is not None
    assert surface.p is not None
    assert surface.p.shape == flow.surface.p.shape
    # The simulation has the pressure of air there, small beside that of 10 of grains.
    assert float(np.abs(surface.p).max()) < 0.5


def test_crossings_of_a_block() -> None:
    c = np.zeros((6, 6))
    c[:3, :2] = 1
    c[3, :2] = 0.25
    places = crossings(c, 0.5)
    top = places[places[:, 0] < 0.8]
    # c falls from 1 at y = 1.25 to 0.25 at 1.75: it is 1/2 at 2/3 of the way.
    np.testing.assert_allclose(sorted({x for x, _ in top.round(9)}), [0.0, 0.25, 0.75])
    np.testing.assert_allclose(top[:, 1], 1.25 + 0.5 * 2 / 3)
    side = places[places[:, 0] >= 0.8]
    np.testing.assert_allclose(side[:, 0], 1.0)
    np.testing.assert_allclose(sorted(side[:, 1]), [0.0, 0.25, 0.75, 1.25])
    assert crossings(np.ones((4, 4)), 1.0).shape == (0, 2)
