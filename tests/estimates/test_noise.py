"""The noise that is estimated from the vectors equals the noise that was added."""

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, Particles, add_noise, particle_flow
from granpinn.data.noise import max_speed
from granpinn.inspection import inspect

pytestmark = pytest.mark.usefixtures("no_balance")
TOLERANCE = 0.25  # what is promised


def as_particles(flow: Flow, seed: int, per_frame: int = 1500, every: int = 4) -> Flow:
    """Grains at random places of the flow, with its velocity there."""
    from scipy.interpolate import RegularGridInterpolator

    generator = np.random.default_rng(seed)
    parts = []
    for k in range(0, flow.t.size, every):
        rows, columns = np.nonzero(flow.valid[k])
        pick = generator.choice(rows.size, min(per_frame, rows.size), replace=False)
        step = flow.x[1] - flow.x[0]
        y = flow.y[rows[pick]] + step * generator.uniform(-0.5, 0.5, pick.size)
        x = flow.x[columns[pick]] + step * generator.uniform(-0.5, 0.5, pick.size)
        place = np.stack([np.clip(y, *flow.y[[0, -1]]), np.clip(x, *flow.x[[0, -1]])], -1)
        u, v = (RegularGridInterpolator((flow.y, flow.x), a[k])(place) for a in (flow.u, flow.v))
        there = np.isfinite(u) & np.isfinite(v)
        parts.append(np.stack([np.full(pick.size, flow.t[k]), x, y, u, v])[:, there])
    t, x, y, u, v = np.concatenate(parts, axis=1)
    particles = Particles(t, x, y, u.astype(np.float32), v.astype(np.float32))
    return particle_flow(
        particles,
        gravity=flow.gravity,
        density=flow.density,
        grain_diameter=flow.grain_diameter,
        surface=flow.surface,
    )


@pytest.mark.parametrize("sd", [0.01, 0.2])
def test_noise_of_a_grid(demo: Flow, seed: int, sd: float) -> None:
    found = inspect(add_noise(demo, sd, seed))
    expected = sd * max_speed(demo)
    noise = found["noise"]
    for estimate in (noise.sigma, noise.u, noise.v):
        assert estimate is not None
        assert estimate == pytest.approx(expected, rel=TOLERANCE)
    assert found["noise"].relative == pytest.approx(sd, rel=TOLERANCE)
    assert found["noise"].vectors_per_independent < 1.2


def test_noise_is_that_of_a_typical_vector(demo: Flow, seed: int) -> None:
    """One vector in a hundred has ten times the error: half of the variance is theirs."""
    sd = 0.05
    noisy = add_noise(demo, sd, seed)
    wrong = np.random.default_rng(seed).uniform(size=demo.u.shape) < 0.01
    u, v = (
        np.where(wrong, clean + 10 * (found - clean), found).astype(np.float32)
        for clean, found in ((demo.u, noisy.u), (demo.v, noisy.v))
    )
    expected = sd * max_speed(demo)
    rms = np.sqrt(np.mean((u - demo.u)[demo.valid] ** 2))
    assert rms > 1.3 * expected
    found = inspect(replace(demo, u=u, v=v))
    assert found["noise"].sigma == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("sd", [0.01, 0.2])
def test_noise_of_particles(demo: Flow, seed: int, sd: float) -> None:
    flow = as_particles(demo, seed)
    found = inspect(add_noise(flow, sd, seed))
    assert found["noise"].sigma is not None
    expected = sd * max_speed(flow)
    assert found["noise"].sigma == pytest.approx(expected, rel=TOLERANCE)
    assert found["vectors"].scattered
    assert found["precision"].expected is not None


def test_noise_of_neighbors_that_share_pixels(demo: Flow, seed: int) -> None:
    """Means over 2 x 2 cells: each error is shared by neighbors, and differences in time see it."""
    generator = np.random.default_rng(seed)
    sigma = 0.05 * max_speed(demo)

    def shared() -> np.ndarray:
        e = generator.standard_normal((demo.t.size, demo.y.size + 1, demo.x.size + 1))
        return sigma * (e[:, 1:, 1:] + e[:, :-1, 1:] + e[:, 1:, :-1] + e[:, :-1, :-1]) / 2

    flow = replace(
        demo,
        u=(demo.u + shared()).astype(np.float32),
        v=(demo.v + shared()).astype(np.float32),
    )
    found = inspect(flow)
    assert found["noise"].sigma == pytest.approx(sigma, rel=0.1)
    # Correlation 1/2 with either neighbor in x and y: (1 + 2/2)^2.
    assert found["noise"].vectors_per_independent == pytest.approx(4, rel=0.2)
