"""The imaginary camera: spots, motion, noise, edges."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from bench.studies.experiment.particle_images import (
    Camera,
    advect,
    expose,
    grain_level,
    render,
    seed_grains,
    surface_points,
    take_pair,
)
from tests.bench import scene

CAMERA = Camera(pixel=0.25, rows=256, columns=256)


def displacement(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """(right, up) in px from the peak of the cross-correlation, by parabolas through its log."""
    first, second = (picture - picture.mean() for picture in (a, b))
    product = np.fft.rfft2(second) * np.conj(np.fft.rfft2(first))
    correlation = np.fft.irfft2(product, s=a.shape)
    row, column = np.unravel_index(np.argmax(correlation), a.shape)
    found = []
    for axis, peak in ((1, column), (0, row)):
        line = correlation[row] if axis == 1 else correlation[:, column]
        low, top, high = np.log([line[peak - 1], line[peak], line[(peak + 1) % line.size]])
        shift = peak + (low - high) / (2 * (low - 2 * top + high))
        found.append((shift + line.size / 2) % line.size - line.size / 2)
    return np.array([found[0], -found[1]])


@pytest.mark.parametrize("motion", [(5.0, 0.0), (2.3, -3.6), (-0.4, 7.7)])
def test_a_translation_is_seen_to_a_tenth_of_a_pixel(
    motion: tuple[float, float], seed: int
) -> None:
    delay = 0.5
    u, v = (m * CAMERA.pixel / delay for m in motion)
    pair = take_pair(scene.field(u, v), 1.0, delay, CAMERA, np.random.default_rng(seed))
    middle = slice(64, 192)  # away from the edges, where grains come and go
    found = displacement(*(picture[middle, middle] for picture in pair))
    np.testing.assert_allclose(found, motion, atol=0.1)


def test_the_light_of_a_spot(seed: int) -> None:
    """Each spot gives 2 pi sigma^2 A, but for the tails beyond four sigma."""
    random = np.random.default_rng(seed)
    points = random.uniform(10, 246, (2, 50))
    brightness = random.uniform(1, 100, 50)
    light = render(points, brightness, CAMERA)
    expected = 2 * math.pi * CAMERA.sigma**2 * brightness.sum()
    assert light.sum() == pytest.approx(expected, rel=1e-3)
    # The center of the light of one spot is the grain: y up from the lower edge.
    one = render(points[:, :1], brightness[:1], CAMERA)
    columns = (one.sum(axis=0) * (np.arange(256) + 0.5)).sum() / one.sum()
    rows = (one.sum(axis=1) * (np.arange(256) + 0.5)).sum() / one.sum()
    np.testing.assert_allclose([columns, 256 - rows], points[:, 0], atol=5e-3)


def test_spots_beyond_the_edge_leave_only_their_tail() -> None:
    points = np.array([[-1.0, 300.0], [10.0, 100.0]])
    light = render(points, np.array([100.0, 100.0]), CAMERA)
    assert 0 < light.sum() < 2 * math.pi * CAMERA.sigma**2 * 100
    assert light[:, 20:].sum() == 0


def test_advection_follows_a_rotation() -> None:
    """The midpoint rule is wrong by (omega span)^3 / 6 of the radius."""
    omega, span = 0.5, 0.2
    spin = scene.field(lambda x, y, t: -omega * (y - 32), lambda x, y, t: omega * (x - 32))
    points = np.array([[40.0, 30.0], [32.0, 22.0]])
    moved = advect(spin, points, 1.0, span)
    a = omega * span
    x, y = points - 32
    exact = np.stack([x * math.cos(a) - y * math.sin(a), x * math.sin(a) + y * math.cos(a)])
    np.testing.assert_allclose(moved - 32, exact, atol=10.2 * a**3 / 6 + 1e-5)


def test_the_field_is_linear_between_cells_and_frames() -> None:
    linear = scene.field(lambda x, y, t: 2 * x - y + 3 * t, lambda x, y, t: x * 0 + t)
    x, y = np.array([3.3, 40.1]), np.array([17.2, 5.9])
    u, v = linear.velocity(0.7, x, y)
    np.testing.assert_allclose(u, 2 * x - y + 2.1, rtol=1e-6)
    np.testing.assert_allclose(v, 0.7, rtol=1e-6)


def test_velocity_goes_on_beyond_the_surface() -> None:
    flowing = scene.field(1.5, -0.5, top=30.0)
    x = np.full(3, 20.0)
    u, v = flowing.velocity(1.0, x, np.array([29.0, 31.0, 60.0]))
    np.testing.assert_allclose(u, [1.5, 1.5, 0.0])
    np.testing.assert_allclose(v, [-0.5, -0.5, 0.0])


def test_grains_are_in_the_material_only(seed: int) -> None:
    still = scene.field(0.0, 0.0, top=30.0)
    random = np.random.default_rng(seed)
    grains = seed_grains(still, 1.0, CAMERA, random)
    assert grains[1].max() < 30.0
    area = 64 * 30 / CAMERA.pixel**2
    assert grains.shape[1] == pytest.approx(area / CAMERA.spacing**2, rel=0.05)
    first, _ = take_pair(still, 1.0, 0.1, CAMERA, random)
    above = first[: 256 - 30 * 4 - 8].astype(np.float64)
    assert above.mean() == pytest.approx(CAMERA.dark, abs=0.1)
    assert above.std() == pytest.approx(math.hypot(CAMERA.read, 12**-0.5), rel=0.05)
    assert first[256 - 100 :].mean() > 3 * CAMERA.dark


def test_noise_of_the_camera(seed: int) -> None:
    light = np.full((256, 256), 100.0)
    levels = expose(light, CAMERA, np.random.default_rng(seed)).astype(np.float64)
    assert levels.mean() == pytest.approx(108, abs=0.1)
    variance = CAMERA.read**2 + CAMERA.photon * 100 + 1 / 12
    assert levels.var() == pytest.approx(variance, rel=0.05)


def test_pictures_are_a_function_of_the_seed() -> None:
    moving = scene.field(1.0, 0.0)
    first, again, other = (
        take_pair(moving, 1.0, 0.5, CAMERA, np.random.default_rng(n)) for n in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first[0] != other[0]).any()


def test_the_line_of_the_surface(seed: int) -> None:
    """A level edge at y = 30 (120 px) that rises by 4 px in a pair: half way, to one pixel."""
    rising = scene.field(0.0, 1.0, top=30.0)
    pair = take_pair(rising, 1.0, 1.0, CAMERA, np.random.default_rng(seed))
    x, y = surface_points(grain_level(pair))
    assert x.size >= 256
    assert abs(np.median(y) - 120) < 0.5
    assert np.abs(y - 120).max() < 4  # one grain more or less at the edge


def test_surface_points_are_where_the_level_is_a_half() -> None:
    rows, columns = 40, 50
    y = rows - np.arange(rows) - 0.5
    x = np.arange(columns) + 0.5
    level = 0.5 - 0.1 * (y[:, None] + 0.5 * x - 25.3)  # falls upwards and to the right
    found = surface_points(np.clip(level, 0, 1))
    np.testing.assert_allclose(found[1] + 0.5 * found[0], 25.3, atol=1e-9)
    assert found.shape[1] > 50
