"""Derivatives, their errors, and the pressure against known values."""

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import estimated_pressure
from granpinn.estimates.gradients import gradients, view_of
from granpinn.inspection import inspect
from tests.flows import make_flow


def shear(*, noise: float = 0.0, seed: int = 0) -> Flow:
    """u = 2 y + 3 t, v = -x: linear, so that windows have no error of their own."""
    flow = make_flow(frames=16, rows=24, columns=24)
    t, y, x = np.meshgrid(flow.t, flow.y, flow.x, indexing="ij")
    generator = np.random.default_rng(seed)
    u, v = 2 * y + 3 * t, -x
    u, v = (a + noise * generator.standard_normal(a.shape) for a in (u, v))
    c = np.ones_like(flow.c)
    return replace(flow, u=u.astype(np.float32), v=v.astype(np.float32), c=c, surface=None, p=None)


def test_a_linear_flow_is_exact() -> None:
    flow = shear()
    scales = scales_of(flow)
    found = gradients(view_of(flow, scales), 0.0)
    rate, g = 1 / scales.time, 9.81
    np.testing.assert_allclose(found.du[:, 0] * g, 3, rtol=1e-4)
    np.testing.assert_allclose(found.du[:, 1:] * rate, [[2, 0]] * found.u.size, atol=1e-4)
    np.testing.assert_allclose(found.dv[:, 1:] * rate, [[0, -1]] * found.u.size, atol=1e-4)
    np.testing.assert_allclose(found.gamma_dot * rate, 1.0, rtol=1e-4)  # |u_y + v_x| = 2 - 1
    np.testing.assert_allclose(found.divergence, 0, atol=1e-5)
    # Dv/Dt = (3 + v u_y, u v_x) = (3 - 2 x, -(2 y + 3 t)).
    x = flow.x[found.index[2]]
    np.testing.assert_allclose(found.acceleration[:, 0] * g, 3 - 2 * x, atol=1e-3)


def test_errors_are_those_of_the_noise(seed: int) -> None:
    """Scatter of the slopes over their stated deviations is 1; overlapping windows, so 10 %."""
    noise = 0.05
    flow = shear(noise=noise, seed=seed)
    scales = scales_of(flow)
    found = gradients(view_of(flow, scales), noise / scales.velocity)
    slope = (found.du[:, 1] / scales.time - 2) / (found.sd[:, 1] / scales.time)
    assert np.sqrt(np.mean(slope**2)) == pytest.approx(1, abs=0.1)
    bias = np.mean((found.du[:, 2] - found.dv[:, 1]) ** 2 + (found.du[:, 1] + found.dv[:, 2]) ** 2)
    assert bias - np.mean(found.bias) == pytest.approx(scales.time**2, rel=0.1)


def test_pressure_at_rest_is_hydrostatic() -> None:
    flow = shear()
    flow = replace(flow, u=0 * flow.u, v=0 * flow.v)
    scales = scales_of(flow)
    view = view_of(flow, scales)
    found = gradients(view, 0.0)
    p = estimated_pressure(view, found) * scales.pressure
    top = flow.y[-1] + (flow.y[1] - flow.y[0]) / 2
    np.testing.assert_allclose(p, 1500 * 9.81 * (top - flow.y[found.index[1]]), rtol=1e-6)


def test_pressure_and_inertial_numbers_of_a_collapse(demo: Flow) -> None:
    """Within a factor 2 for nine tenths of the flowing points, where solved pressure is known."""
    found = inspect(demo)
    assert demo.p is not None
    index = tuple(i[found.inertia.flows] for i in found.facts.slopes.index)
    true = np.maximum(demo.p[index] / found.scales.pressure, 1e-4)
    I_true = found.facts.view.d * found.facts.slopes.gamma_dot[found.inertia.flows] / np.sqrt(true)
    ratio = found.inertia.I[found.inertia.flows] / I_true
    assert np.mean((ratio > 0.5) & (ratio < 2)) > 0.9
