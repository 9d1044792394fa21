"""Noise that is drawn for simulated flows: its level, its correlation, its seed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from granpinn.data import Flow, add_noise
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.second_opinion.drawn_noise import DrawnNoise, noise_of, with_noise
from granpinn.simulation import Collapse, simulate


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(0.4, 0.64, cells=64, stride=1, frames=20, t_end=3.0, threads=1))


def test_the_noise_has_the_level_of_the_data(flow: Flow) -> None:
    noisy = add_noise(flow, 0.03, seed=1)
    noise = noise_of(noisy, flow)
    made, scales = with_noise(flow, noise, 2), scales_of(noisy)
    # Medians of some 10,000 differences of four frames each: 2 % for one flow.
    found, wanted = (Facts(f, scales).noise.sigma for f in (made, noisy))
    assert found == pytest.approx(wanted, rel=0.06)
    assert isinstance(noisy.sigma_u, float)
    assert noise.sd == pytest.approx((noisy.sigma_u, noisy.sigma_u), rel=0.06)
    np.testing.assert_array_equal(np.isnan(made.u), np.isnan(flow.u))
    speed = np.sqrt(np.nanmean(flow.u.astype(float) ** 2 + flow.v.astype(float) ** 2))
    # Magnitudes of the facts are rounded to a quarter of an octave.
    assert noise.percent == pytest.approx(100 * noisy.sigma_u / speed, rel=0.2)


def test_the_noise_is_a_function_of_the_seed(flow: Flow) -> None:
    noise = DrawnNoise((0.1, 0.2), 1.0)
    first, same, other = (with_noise(flow, noise, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.u, same.u)
    for name, sd in (("u", 0.1), ("v", 0.2)):
        a, b = ((getattr(f, name) - getattr(flow, name))[flow.valid] for f in (first, other))
        count = a.size
        assert a.std() == pytest.approx(sd, rel=4 / math.sqrt(2 * count))
        assert abs(np.corrcoef(a, b)[0, 1]) < 4 / math.sqrt(count)


def test_noise_varies_as_the_file_states(flow: Flow) -> None:
    """Vectors with twice the stated noise get twice as much; few vectors get the stated noise."""
    sigma = np.full(flow.u.shape, 0.1, np.float32)
    sigma[:, :, 3:] = 0.2
    sigma[0, -1, -1] = np.nan  # no vector there
    stated = dataclasses.replace(flow, sigma_u=sigma, sigma_v=sigma)
    cut = {
        name: getattr(stated, name)[:2, :3, :3] for name in ("u", "v", "c", "sigma_u", "sigma_v")
    }
    few = dataclasses.replace(
        stated, t=flow.t[:2], y=flow.y[:3], x=flow.x[:3], p=None, surface=None, **cut
    )
    assert Facts(few, scales_of(few)).noise.sigma is None
    typical = float(np.float32(0.1))
    assert noise_of(few, few).sd == pytest.approx((typical, typical))
    added = with_noise(stated, DrawnNoise((typical, typical), 1.0), 3).u - flow.u
    for columns, sd in ((slice(3), 0.1), (slice(3, None), 0.2)):
        there = added[:, :, columns][flow.valid[:, :, columns]]
        assert there.std() == pytest.approx(sd, rel=4 / math.sqrt(2 * there.size))


def test_correlated_noise_has_few_independent_vectors(flow: Flow) -> None:
    """The variance of the mean of a frame is that of its independent vectors."""
    shape = (600, 24, 30)
    still = np.zeros(shape, np.float32)
    t = np.arange(600) / 10
    wide = dataclasses.replace(
        flow, t=t, x=flow.x[:30], y=flow.y[:24], u=still, v=still, c=still + 1, surface=None, p=None
    )
    made = with_noise(wide, DrawnNoise((0.1, 0.1), 1.0, 6.0), 7)
    frames = np.concatenate([made.u, made.v]).astype(np.float64)
    assert frames.std() == pytest.approx(0.1, rel=0.02)
    number = frames.mean(axis=(1, 2)).var() / 0.1**2 * (24 * 30)
    assert number == pytest.approx(6.0, rel=4 * math.sqrt(2 / len(frames)))
