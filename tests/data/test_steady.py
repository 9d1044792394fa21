"""Steady flows found from the data, and their means over time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granpinn.arrays import Float64
from granpinn.data import Flow, add_noise, check_flow, large
from granpinn.data.noise import max_speed
from granpinn.data.symmetry import HARMFUL, PARTS, _has_trend, is_steady, said, steady_mean
from tests.flows import make_chute, make_flow

FRAMES = 60


def correlated(draw: np.random.Generator, shape: tuple[int, ...], time: float) -> Float64:
    """Noise of variance 1 that decays as exp(-k / time) over k frames; the first axis is time."""
    kept = math.exp(-1 / time) if time else 0.0
    found = draw.normal(size=shape)
    for k in range(1, shape[0]):
        found[k] = kept * found[k - 1] + math.sqrt(1 - kept**2) * found[k]
    return found


def filmed(seed: int, *, sd: float = 0.2, time: float = 0.0, **changes: Any) -> Flow:
    """A steady chute as a film, with noise on each vector that is correlated over some frames; the
    file does not say that it is steady."""
    flow = make_chute(frames=FRAMES, attributes={"period_x": 32.0}, p=None)
    draw = np.random.default_rng(seed)
    noise = [sd * correlated(draw, flow.u.shape, time) for _ in range(2)]
    return replace(flow, u=flow.u + noise[0], v=flow.v + noise[1], **changes)


def sped(flow: Flow, factor: Float64) -> Flow:
    """The flow with its velocity times a factor in each frame."""
    return replace(flow, u=flow.u * factor[:, None, None], v=flow.v * factor[:, None, None])


@pytest.mark.parametrize(("time", "most"), [(0.0, 0.015), (1 / 20, 0.05)])
def test_false_alarms(time: float, most: float, seed: int) -> None:
    """1 % with white noise, 4 % with noise that is correlated over 1/20 of the record."""
    noise = correlated(np.random.default_rng(seed), (200, 4000), 200 * time)
    means = noise.reshape(PARTS, -1, 4000).mean(axis=1).T
    found = np.mean([_has_trend(1 + 0.01 * series, np.ones(PARTS)) for series in means])
    assert 0.005 < found < most


@pytest.mark.parametrize(
    "shape",
    [np.linspace(-0.5, 0.5, 200), np.exp(-np.arange(200) / 20), np.exp(np.arange(-199, 1) / 20)],
    ids=["rate", "start", "end"],
)
def test_trends_are_found(shape: Float64, seed: int) -> None:
    """A change of 15 standard deviations of the means over parts, in at least 95 %."""
    noise = np.random.default_rng(seed).normal(size=(1000, PARTS))
    means = noise + 15 * shape.reshape(PARTS, -1).mean(axis=1)
    assert np.mean([_has_trend(series, np.ones(PARTS)) for series in means]) > 0.95


@pytest.mark.parametrize("time", [0.0, 1.0, FRAMES / 20])
@pytest.mark.parametrize("sd", [0.0, 0.02, 0.5])
def test_a_filmed_chute_is_its_mean(sd: float, time: float, seed: int) -> None:
    flow = filmed(seed, sd=sd, time=time)
    assert is_steady(flow)
    found = steady_mean(flow)
    check_flow(found)
    assert (found.t.size, found.averaged, found.steady) == (1, FRAMES, True)
    exact = make_chute()
    np.testing.assert_array_equal(found.c, exact.c)
    np.testing.assert_array_equal(np.isfinite(found.u), np.isfinite(exact.u))
    assert said(found) == (
        "the flow is steady (its changes are within noise and sampling error): the mean over its "
        f"{FRAMES} frames is used"
    )
    if sd == 0:
        assert (found.sigma_u, found.sigma_v) == (None, None)
        np.testing.assert_allclose(found.u, exact.u, rtol=1e-6)
    else:
        error = (found.u - exact.u)[exact.valid]
        assert found.sigma_u == pytest.approx(math.sqrt(np.mean(error**2)), rel=0.35)
        assert found.sigma_v == pytest.approx(found.sigma_u, rel=0.35)


def test_whatever_changes_is_no_steady_flow(seed: int) -> None:
    """Also where noise hides the change in each vector."""
    flow = filmed(seed)
    s = (flow.t - flow.t[0]) / float(np.ptp(flow.t))
    rms = math.sqrt(float(np.nanmean(np.square(make_chute().u))))
    rate = 1.3 * HARMFUL * math.hypot(*flow.gravity) * float(np.ptp(flow.t)) / rms
    assert is_steady(sped(flow, 1 + 0.02 * np.sin(2 * np.pi * 9 * s)))
    for factor in (
        1 + rate * (s - 0.5),  # speeds up
        1 - rate * (s - 0.5),
        1 - np.exp(-s / 0.1),  # starts from rest
        np.exp(-s),  # comes to rest
        np.cos(2 * np.pi * 9 * s),  # to and fro
    ):
        assert not is_steady(sped(flow, factor))
    clean = filmed(seed, sd=1e-4)
    for small in (1e-3 * s, -2e-3 * np.exp(-s / 0.1)):
        assert is_steady(sped(flow, 1 + small))
        assert not is_steady(sped(clean, 1 + small))


def test_what_the_file_states_overrules(seed: int) -> None:
    steady, moving = filmed(seed), make_flow(p=None)
    kept = replace(steady, attributes={"steady": 0})
    assert steady_mean(kept) is kept
    assert steady_mean(moving) is moving
    found = steady_mean(replace(moving, attributes={"steady": 1}))
    assert (found.t.size, found.averaged) == (1, moving.t.size)
    assert "(the file says so)" in str(said(found))


def test_one_frame_and_few_frames(seed: int) -> None:
    """One frame stays as it is; fewer frames than parts are a mean if the file says so."""
    one = make_chute(sigma_u=0.1, sigma_v=0.2)
    found = steady_mean(one)
    np.testing.assert_array_equal(found.u, one.u)
    assert (found.sigma_u, found.sigma_v, said(found)) == (0.1, 0.2, None)
    few = large.some_frames(filmed(seed), slice(0, PARTS - 1))
    assert steady_mean(few) is few
    two = add_noise(make_chute(frames=2), 0.05, seed)
    found = steady_mean(two)
    assert found.sigma_u == pytest.approx(0.05 * max_speed(make_chute()) / math.sqrt(2), rel=0.2)


def test_the_line_of_the_mean() -> None:
    """The mean of lines that fluctuate, with their pressure."""
    draw = np.random.default_rng(1)
    flow = make_chute(frames=FRAMES)
    assert flow.surface is not None
    place = flow.surface
    rough = place.y + 0.4 * draw.normal(size=place.y.size)
    pressure = (10 * rough).astype(np.float32)
    flow = replace(flow, surface=replace(place, y=rough, p=pressure))
    line = steady_mean(flow).surface
    assert line is not None
    assert line.p is not None
    np.testing.assert_allclose(line.x, flow.x)
    np.testing.assert_allclose(line.y, rough.reshape(FRAMES, -1).mean(axis=0))
    np.testing.assert_allclose(line.p, 10 * line.y, rtol=1e-5)


def test_gaps_and_partly_filled_cells(seed: int) -> None:
    """A mean over the vectors there are, weighted with c; a cell with few of them has none."""
    flow, draw = filmed(seed, sd=0.05), np.random.default_rng(seed)
    gaps = draw.random(flow.u.shape) < 0.6
    gaps[1:, 4, 5] = True
    u, v, c = np.where(gaps, np.nan, flow.u), np.where(gaps, np.nan, flow.v), flow.c.copy()
    row = int(np.flatnonzero(c[0, :, 0])[-1]) + 1
    u[:, row], v[:, row], c[:, row] = 1.0, 0.0, 0.75
    u[::2, row], c[::2, row] = 4.0, 0.25
    gappy = replace(flow, u=u, v=v, c=c)
    assert is_steady(gappy)
    found = steady_mean(gappy)
    assert np.isnan(found.u[0, 4, 5])
    assert found.valid.sum() == make_chute().valid.sum() - 1
    np.testing.assert_allclose(found.u[0, row], (4 * 0.25 + 0.75) / (0.25 + 0.75))
    np.testing.assert_allclose(found.c[0, row], 0.5)
    exact = make_chute().u
    assert np.nanmax(np.abs(found.u - exact)[0, :row]) < 0.06
