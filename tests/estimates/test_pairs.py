"""The noise from pairs of vectors equals the noise that was added, beside gaps and scattered."""

import numpy as np
import pytest

from granpinn.arrays import Float64
from granpinn.data import Particles, particle_flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.estimates.noise import pair_noise
from granpinn.inspection import inspect

FRAMES, SIDE, PER_FRAME = 24, 30.0, 200
WAVES = 300


def random_field(x: Float64, y: Float64, length: float, seed: int) -> Float64:
    """Two normal fields [2, n] with the correlation exp(-h^2 / (2 length^2)); white for 0."""
    generator = np.random.default_rng(seed)
    if length == 0:
        return generator.standard_normal((2, x.size))
    waves = generator.standard_normal((2, WAVES)) / length
    phases = generator.uniform(0, 2 * np.pi, (2, 1, WAVES))
    turns = np.outer(x, waves[0]) + np.outer(y, waves[1]) + phases
    return np.asarray(np.sqrt(2 / WAVES) * np.cos(turns).sum(axis=-1))


def vectors(
    length: float, seed: int, *, cells: bool, frames: int = FRAMES, sd: float = 0.05
) -> tuple[list[Float64], float]:
    """t, x, y, u, v of a smooth flow with noise, and the number of vectors that share one error.

    Args:
        cells: at the centers of randomly chosen cells, or anywhere.
    """
    generator = np.random.default_rng(seed)
    made, sharing = [], []
    for k in range(frames):
        if cells:
            place = generator.choice(int(SIDE) ** 2, PER_FRAME, replace=False)
            x, y = (a.astype(float) for a in np.divmod(place, int(SIDE)))
        else:
            x, y = generator.uniform(0, SIDE, (2, PER_FRAME))
        e = sd * random_field(x, y, length, seed + 1 + k)
        a, b, c = x / 10, y / 10, k / 12
        u, v = np.sin(a + c) * np.cos(b), np.cos(a) * np.sin(b - c)
        made.append(np.stack([np.full(PER_FRAME, 0.1 * k), x, y, u + e[0], v + e[1]]))
        if length > 0:
            square = (x - x[:, None]) ** 2 + (y - y[:, None]) ** 2
            sharing.append(np.exp(-square / 2 / length**2).sum() / PER_FRAME)
    return [*np.concatenate(made, axis=1)], float(np.mean(sharing or [1.0]))


@pytest.mark.parametrize("length", [0.0, 1.5, 3.0])
@pytest.mark.parametrize("cells", [True, False])
def test_size_and_correlation(length: float, cells: bool, seed: int) -> None:
    data, truth = vectors(length, seed, cells=cells)
    found = pair_noise(*data)
    assert found is not None
    assert [found.u, found.v] == pytest.approx([0.05, 0.05], rel=0.2)
    assert found.vectors_per_independent == pytest.approx(truth, rel=0.25)


def test_order_units_and_a_few_bad_vectors_do_not_matter(seed: int) -> None:
    data, truth = vectors(1.5, seed, cells=False)
    plain = pair_noise(*data)
    assert plain is not None
    generator = np.random.default_rng(seed)
    order = generator.permutation(data[0].size)
    factors = (3.0, 0.2, 0.2, 7.0, 7.0)
    other = pair_noise(*(factor * a[order] for factor, a in zip(factors, data, strict=True)))
    assert other is not None
    assert other.u == pytest.approx(7 * plain.u, rel=1e-6)
    assert other.vectors_per_independent == pytest.approx(plain.vectors_per_independent, rel=1e-6)
    wrong = generator.uniform(size=order.size) < 0.01
    bad = pair_noise(*data[:3], *(np.where(wrong, 5.0, a) for a in data[3:]))
    assert bad is not None
    assert bad.u == pytest.approx(0.05, rel=0.25)
    assert bad.vectors_per_independent == pytest.approx(truth, rel=0.4)


def test_particles_that_share_errors(seed: int) -> None:
    """Grains that move together: parabolas of one frame follow them, predictions do not."""
    (t, x, y, u, v), truth = vectors(3.0, seed, cells=False)
    particles = Particles(t, x, y, u.astype(np.float32), v.astype(np.float32))
    flow = particle_flow(particles, gravity=(0.0, -1.0), density=1.0, grain_diameter=1.0)
    found = inspect(flow)
    noise = found["noise"]
    assert noise.sigma is not None
    assert noise.sigma == pytest.approx(0.05, rel=0.2)
    assert noise.vectors_per_independent == pytest.approx(truth, rel=0.25)
    text = " ".join(found.lines())
    assert "neighbors share one error" in text
    again = particle_flow(
        particles, gravity=(0.0, -1.0), density=1.0, grain_diameter=1.0, attributes={"steady": 1}
    )
    assert Facts(again, scales_of(again)).noise.vectors_per_independent == 1
