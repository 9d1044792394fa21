"""Tolerances that follow the flow: units, noise, and the law in fast grains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.scaling import scales_of
from granpinn.physics.terms import NAMES
from granpinn.simulation import demo_path
from granpinn.training.tolerances import (
    RESOLVED,
    STEPS,
    Magnitudes,
    law_rate,
    magnitudes_of,
    sigmas_of,
)
from tests.data.test_particles import FLOW as SCATTERED
from tests.flows import make_flow

ROUNDED = 2 ** (0.5 / STEPS) - 1


def magnitudes(flow: Flow) -> Magnitudes:
    return magnitudes_of(flow, scales_of(flow))


def sigma(name: str, found: Magnitudes, **settings: object) -> float:
    config = Config(**settings)  # type: ignore[arg-type]
    return sigmas_of(config, scales_of(make_flow()), found)[NAMES.index(name)]


@pytest.fixture(scope="module")
def demo() -> Flow:
    return read_flow(demo_path())


def test_speed_and_shear_rate_are_those_of_the_vectors() -> None:
    flow = make_flow(frames=12, rows=48, columns=40)
    scales, found = scales_of(flow), magnitudes(flow)
    grains = flow.valid
    speed = np.hypot(flow.u, flow.v)[grains] / scales.velocity
    assert found.velocity == pytest.approx(float(np.sqrt(np.mean(speed**2))), rel=ROUNDED)
    t, y, x = np.meshgrid(flow.t, flow.y, flow.x, indexing="ij")
    a = 4 * t / (1 + 2 * t**2)
    rate = np.hypot(2 * a * (1 + y / 2), a * x / 2)[grains] * scales.time
    assert found.rate == pytest.approx(float(np.sqrt(np.mean(rate**2))), rel=0.05 + ROUNDED)


@pytest.mark.parametrize("sd", [0.02, 0.2])
def test_noise_is_measured_and_leaves_the_shear_rate(demo: Flow, sd: float) -> None:
    clean, noisy = magnitudes(demo), magnitudes(add_noise(demo, sd, 0))
    speed = float(np.hypot(demo.u, demo.v)[demo.valid].max()) / scales_of(demo).velocity
    assert noisy.noise == pytest.approx(sd * speed, rel=0.05 + ROUNDED)
    assert clean.noise < 1e-4
    assert noisy.rate == pytest.approx(clean.rate, rel=0.3 + ROUNDED)
    assert noisy.share == pytest.approx(math.sqrt(RESOLVED / demo.valid.sum()), rel=0.05)


def test_few_vectors_take_all_of_their_noise() -> None:
    assert magnitudes(make_flow()).share == 1


def test_scattered_vectors_have_magnitudes() -> None:
    found = magnitudes(SCATTERED)
    assert found.velocity > 0
    assert found.rate > 0


def test_too_few_vectors_for_a_measurement_have_the_stated_noise() -> None:
    flow = make_flow(frames=1, rows=6, columns=5, attributes={"steady": 1})
    flow = replace(flow, sigma_u=0.3, sigma_v=0.3)
    assert magnitudes(flow).noise == pytest.approx(0.3 / scales_of(flow).velocity, rel=ROUNDED)


def test_grains_at_rest_have_units() -> None:
    flow = make_flow()
    still = replace(flow, u=0 * flow.u, v=0 * flow.v)
    found = magnitudes(still)
    assert (found.velocity, found.rate) == (1, 1)


def test_tolerances_scale_with_the_flow() -> None:
    slow, fast = Magnitudes(0.1, 0.5, 0, 1), Magnitudes(0.2, 2.0, 0, 1)
    assert sigma("velocity", fast) == pytest.approx(2 * sigma("velocity", slow))
    for name in ("continuity", "constitutive"):
        assert sigma(name, fast) == pytest.approx(4 * sigma(name, slow))
    for name in ("surface", "momentum"):
        assert sigma(name, fast) == sigma(name, slow)
    for name in NAMES:
        plain = sigma(name, fast, weights__units="dimensionless")
        assert plain == Config().weights.sigma(name)


def test_the_law_is_relative_above_a_shear_rate() -> None:
    sigmas = [1.0] * (len(NAMES) - 1) + [0.06]
    assert law_rate(sigmas, 0.03) == pytest.approx(2)
    assert law_rate(sigmas, 0.0) == math.inf
    assert law_rate([math.inf] * len(NAMES), 0.03) == math.inf
