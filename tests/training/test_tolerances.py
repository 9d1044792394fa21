"""Tolerances that follow the flow: units, noise, and the law in fast grains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import STEPS, Facts
from granpinn.physics.terms import NAMES
from granpinn.simulation import demo_path
from granpinn.training.tolerances import (
    RESOLVED,
    VelocityNoise,
    sigmas_of,
)
from tests.flows import make_flow

ROUNDED = 2 ** (0.5 / STEPS) - 1


def facts(flow: Flow) -> Facts:
    return Facts(flow, scales_of(flow))


def sigma(name: str, flow: Flow, **settings: object) -> float:
    config = Config(**settings)  # type: ignore[arg-type]
    return sigmas_of(config, scales_of(flow), facts(flow))[NAMES.index(name)]


@pytest.fixture(scope="module")
def demo() -> Flow:
    return read_flow(demo_path())


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
    assert VelocityNoise.of(noisy).share == pytest.approx(
        math.sqrt(RESOLVED / demo.valid.sum()), rel=0.05
    )


def test_tolerances_scale_with_the_flow() -> None:
    slow = make_flow()
    fast = replace(slow, u=2 * slow.u, v=2 * slow.v)
    for name in ("velocity", "continuity", "constitutive"):
        assert sigma(name, fast) == pytest.approx(2 * sigma(name, slow))
    for name in ("surface", "momentum"):
        assert sigma(name, fast) == sigma(name, slow)
    for name in NAMES:
        plain = sigma(name, fast, weights__units="dimensionless")
        assert plain == Config().weights.sigma(name)
