"""Tolerances that follow the flow: units, noise, and the law in fast grains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, add_noise
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import STEPS, Facts
from granpinn.physics.terms import NAMES
from granpinn.training.problem import MOST_COLUMNS, RESOLVED, law_rate, resolved_share, sigmas_of
from tests.flows import make_chute, make_flow

ROUNDED = 2 ** (0.5 / STEPS) - 1


def facts(flow: Flow) -> Facts:
    return Facts(flow, scales_of(flow))


def sigma(name: str, flow: Flow, **settings: object) -> float:
    config = Config(**settings)  # type: ignore[arg-type]
    return sigmas_of(config, scales_of(flow), facts(flow))[NAMES.index(name)]


def test_speed_and_shear_rate_are_those_of_the_vectors() -> None:
    flow = make_flow(frames=12, rows=48, columns=40)
    scales, found = scales_of(flow), facts(flow)
    grains = flow.valid
    speed = np.hypot(flow.u, flow.v)[grains] / scales.velocity
    assert found.speed == pytest.approx(float(np.sqrt(np.mean(speed**2))), rel=ROUNDED)
    t, y, x = np.meshgrid(flow.t, flow.y, flow.x, indexing="ij")
    a = 4 * t / (1 + 2 * t**2)
    rate = np.hypot(2 * a * (1 + y / 2), a * x / 2)[grains] * scales.time
    assert found.shear_rate == pytest.approx(float(np.sqrt(np.mean(rate**2))), rel=0.05 + ROUNDED)


@pytest.mark.parametrize("sd", [0.02, 0.2])
def test_noise_is_measured_and_leaves_the_shear_rate(demo: Flow, sd: float) -> None:
    clean, noisy = facts(demo), facts(add_noise(demo, sd, 0))
    speed = float(np.hypot(demo.u, demo.v)[demo.valid].max()) / scales_of(demo).velocity
    assert noisy.sigma == pytest.approx(sd * speed, rel=0.05 + ROUNDED)
    assert clean.sigma < 1e-4
    assert noisy.shear_rate == pytest.approx(clean.shear_rate, rel=0.3 + ROUNDED)
    assert resolved_share(noisy) == pytest.approx(math.sqrt(RESOLVED / demo.valid.sum()), rel=0.05)


def test_tolerances_scale_with_the_flow() -> None:
    slow = make_flow()
    fast = replace(slow, u=2 * slow.u, v=2 * slow.v)
    for name in ("velocity", "continuity", "constitutive"):
        assert sigma(name, fast) == pytest.approx(2 * sigma(name, slow))
    for name in ("surface", "momentum"):
        assert sigma(name, fast) == sigma(name, slow)


def test_the_momentum_of_a_mean_over_columns_fluctuates_less() -> None:
    wide, narrow = make_chute(columns=36), make_chute(columns=16)
    assert facts(wide).columns == 36
    one = sigma("momentum", make_flow())
    assert sigma("momentum", narrow) == pytest.approx(one / 4)
    assert sigma("momentum", wide) == pytest.approx(one / MOST_COLUMNS**0.5)
    assert sigma("constitutive", wide) == pytest.approx(sigma("constitutive", narrow), rel=0.2)


def test_the_law_is_relative_above_a_shear_rate() -> None:
    sigmas = [1.0] * (len(NAMES) - 1) + [0.06]
    assert law_rate(sigmas, 0.03) == pytest.approx(2)
    assert law_rate(sigmas, 0.0) == math.inf
    assert law_rate([math.inf] * len(NAMES), 0.03) == math.inf
