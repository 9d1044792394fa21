"""Tolerances that follow the flow: units, noise, and the law in fast grains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, add_noise, read_flow, training_set
from granpinn.data.scaling import scales_of
from granpinn.estimates import facts as facts_module
from granpinn.estimates.facts import STEPS, Facts
from granpinn.estimates.view import View, view_of
from granpinn.physics.scales import Scales
from granpinn.physics.terms import NAMES
from granpinn.simulation import demo_path
from granpinn.training import problem
from granpinn.training.problem import (
    MOST_COLUMNS,
    RESOLVED,
    VelocityNoise,
    law_rate,
    sigmas_of,
)
from tests.data.test_particles import FLOW as SCATTERED
from tests.flows import make_chute, make_flow

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


def test_few_vectors_take_all_of_their_noise() -> None:
    assert VelocityNoise.of(facts(make_flow())).share == 1


def test_scattered_vectors_have_facts() -> None:
    found = facts(SCATTERED)
    assert found.speed > 0
    assert found.shear_rate > 0


def test_too_few_vectors_for_a_measurement_have_the_stated_noise() -> None:
    flow = make_flow(frames=1, rows=6, columns=5, attributes={"steady": 1})
    flow = replace(flow, sigma_u=0.3, sigma_v=0.3)
    assert facts(flow).sigma == pytest.approx(0.3 / scales_of(flow).velocity, rel=ROUNDED)


def test_grains_at_rest_have_units() -> None:
    flow = make_flow()
    still = replace(flow, u=0 * flow.u, v=0 * flow.v)
    found = facts(still)
    assert (found.speed, found.shear_rate) == (1, 1)


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


def test_only_what_the_settings_need_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    flow = make_flow()
    scales, data = scales_of(flow), training_set(make_flow(), scales_of(flow), "V2")

    def fail(flow: Flow, scales: Scales) -> View:
        raise AssertionError("the velocity was looked at")

    monkeypatch.setattr(facts_module, "view_of", fail)
    problem.build(Facts(flow, scales), data, Config(recipe="paper"))
    with pytest.raises(AssertionError, match="looked at"):
        problem.build(Facts(flow, scales), data, Config())


def test_a_fact_is_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    flow, made = make_flow(), []

    def counted(flow: Flow, scales: Scales) -> View:
        made.append(flow)
        return view_of(flow, scales)

    monkeypatch.setattr(facts_module, "view_of", counted)
    found = facts(flow)
    assert made == []
    assert found.shear_rate > 0
    assert (found.speed, found.sigma) == (found.speed, found.sigma)
    assert found.slopes is found.slopes
    assert made == [flow]
    light = found.without_arrays()
    assert (light.shear_rate, light.noise, light.independent()) == (
        found.shear_rate,
        found.noise,
        found.independent(),
    )
    assert made == [flow]
    np.testing.assert_array_equal(light.slopes.du, found.slopes.du)
    assert made == [flow, flow]
