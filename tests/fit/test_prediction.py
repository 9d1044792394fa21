"""Predicted fields against nested automatic differentiation, their units and their chunks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.fit import network as network_module
from granpinn.fit.network import TrainedNetwork
from granpinn.fit.prediction import predict
from granpinn.reference.equations import pressure
from granpinn.results.fields import VARIABLES
from tests.examples import make_network
from tests.flows import make_flow

FORMS = ("mixed", "strong")
REFERENCES = ["u_reference", "v_reference", "p_reference"]
PREDICTED = [name for name in VARIABLES if name not in REFERENCES]


@pytest.fixture(scope="module")
def flow() -> Flow:
    return make_flow(frames=4, rows=12, columns=10)


def expected_fields(points: Tensor, network: TrainedNetwork) -> dict[str, Tensor]:
    """The same fields from the oracle: its network, its derivatives, tensors written out."""
    spec, physics, params, theta = network.spec, network.physics, network.params, network.theta
    d, _, _, eta_min, eta_max, _, P, p_floor, *_ = physics
    U = torch.tensor(physics.velocity_scales, dtype=torch.float64)
    network = (spec.widths, spec.input_shift, spec.input_scale)
    z, z_x, z_y, _ = reference.network_jet(points, params, *network, 1)
    p = pressure(z, P)
    gradient = torch.stack([z_x[:, :2], z_y[:, :2]], dim=2)
    gradient = U[:, None] * gradient  # [N, i, j] = d v_i / d x_j
    D = (gradient + gradient.mT) / 2
    d2 = torch.linalg.matrix_norm(D)
    gamma_dot = np.sqrt(2) * d2
    eta = reference.viscosity(gamma_dot, p, theta, d, eta_min, eta_max, p_floor)
    identity = torch.eye(2, dtype=D.dtype)
    divergence = D.diagonal(dim1=1, dim2=2).sum(1)
    tau = 2 * eta[:, None, None] * (D - divergence[:, None, None] / 2 * identity)
    if spec.form == "mixed":
        tau[:, 0, 0], tau[:, 0, 1] = p * z[:, 3], p * z[:, 4]
    e = reference.strong_residual(points, params, theta, *network, list(physics))
    return {
        "u": U[0] * z[:, 0],
        "v": U[1] * z[:, 1],
        "p": p,
        "tau_xx": tau[:, 0, 0],
        "tau_xy": tau[:, 0, 1],
        "D2": d2,
        "I": d * gamma_dot / torch.sqrt(torch.clamp(p.abs(), min=p_floor)),
        "eta": eta,
        "momentum_residual_x": e[:, 0],
        "momentum_residual_y": e[:, 1],
        "divergence": divergence,
    }


@pytest.mark.parametrize("form", FORMS)
def test_fields_agree_with_the_oracle(form: str, flow: Flow) -> None:
    network = make_network(form, flow)
    network = replace(network, physics=network.physics._replace(v_factor=0.6))
    points = torch.rand(200, 3, dtype=torch.float64)
    found, expected = network.evaluate(points), expected_fields(points, network)
    assert list(found) == PREDICTED
    assert list(expected) == PREDICTED
    for name, value in expected.items():
        assert value.norm() > 0
        # gamma_dot^2 + 1e-12 in the library: relative 5e-13 / gamma_dot^2, here below 1e-8
        torch.testing.assert_close(found[name], value, rtol=1e-8, atol=1e-9, msg=name)


@pytest.mark.parametrize("form", FORMS)
def test_the_viscosity_is_inside_its_limits_and_reaches_both(form: str, flow: Flow) -> None:
    network = make_network(form, flow)
    eta = network.evaluate(torch.rand(500, 3, dtype=torch.float64) * 2)["eta"]
    _, _, _, eta_min, eta_max, *_ = network.physics
    assert eta.max() == eta_max
    assert eta.min() >= eta_min
    assert ((eta > eta_min) & (eta < eta_max)).any()
    if form == "strong":  # tension, which the mixed form excludes, has no friction
        assert eta.min() == eta_min


def test_values_lie_at_their_points_in_the_units_of_the_file(flow: Flow) -> None:
    network, scales = make_network("mixed", flow), scales_of(flow)
    fields = predict(flow, network)
    k, row, column = 2, 1, 3
    assert flow.c[k, row, column] == 1
    point = [flow.x[column] / scales.length, flow.y[row] / scales.length, flow.t[k] / scales.time]
    there = expected_fields(torch.tensor([point], dtype=torch.float64), network)
    units = {
        "velocity": scales.velocity,
        "pressure": scales.pressure,
        "rate": 1 / scales.time,
        "viscosity": scales.pressure * scales.time,
        "number": 1.0,
    }
    for name in PREDICTED:
        expected = there[name].item() * units[VARIABLES[name][0]]
        assert fields.frame(name, k)[row, column] == pytest.approx(expected, rel=1e-6), name
    for name, known in (("u", flow.u), ("v", flow.v), ("p", flow.p)):
        assert known is not None
        assert fields.frame(f"{name}_reference", k)[row, column] == known[k, row, column]


@pytest.mark.parametrize("form", FORMS)
def test_a_tilted_camera_sees_the_same_fields_turned(form: str, flow: Flow) -> None:
    """The network lives in upright axes: v = R^T w(R x), tau = R^T sigma R."""
    angle = math.radians(7.0)
    gravity = (9.81 * math.sin(angle), -9.81 * math.cos(angle))
    tilted = replace(flow, gravity=gravity)
    scales, network = scales_of(tilted), make_network(form, tilted)
    fields = predict(tilted, network)
    k, row, column = 2, 1, 3
    R = torch.tensor(
        [[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]],
        dtype=torch.float64,
    )
    torch.testing.assert_close(
        R @ torch.tensor(gravity, dtype=torch.float64) / 9.81,
        torch.tensor([0.0, -1.0], dtype=torch.float64),
    )
    place = torch.tensor([flow.x[column], flow.y[row]], dtype=torch.float64) / scales.length
    t = torch.tensor([flow.t[k] / scales.time], dtype=torch.float64)
    there = expected_fields(torch.cat([R @ place, t])[None], network)
    value = {name: there[name].item() for name in PREDICTED}

    def turned(x: str, y: str) -> list[float]:
        return list((R.T @ torch.tensor([value[x], value[y]], dtype=torch.float64)).tolist())

    a, b = value["tau_xx"], value["tau_xy"]
    tau = R.T @ torch.tensor([[a, b], [b, -a]], dtype=torch.float64) @ R
    value["u"], value["v"] = turned("u", "v")
    value["tau_xx"], value["tau_xy"] = tau[0].tolist()
    value["momentum_residual_x"], value["momentum_residual_y"] = turned(
        "momentum_residual_x", "momentum_residual_y"
    )
    for name in PREDICTED:
        found = fields.frame(name, k)[row, column]
        kind = VARIABLES[name][0]
        if kind != "number":
            found = scales.to_dimensionless(found, kind)  # type: ignore[arg-type]
        assert found == pytest.approx(value[name], rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_chunks_bound_the_memory_and_change_nothing(
    dtype: torch.dtype, flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = make_network("mixed", flow)
    network = replace(network, params=network.params.to(dtype), theta=network.theta.to(dtype))
    whole = predict(flow, network)
    n = whole.index.size
    sizes: list[int] = []

    evaluate = TrainedNetwork.evaluate

    def recorded(self: TrainedNetwork, points: Tensor) -> dict[str, Tensor]:
        assert points.dtype == dtype
        sizes.append(len(points))
        return evaluate(self, points)

    monkeypatch.setattr(TrainedNetwork, "evaluate", recorded)
    monkeypatch.setattr(network_module, "CHUNK", 17)
    parts = predict(flow, network)
    assert n % 17
    assert sizes == [17] * (n // 17) + [n % 17]
    assert list(parts.values) == list(whole.values)
    for name, value in whole.values.items():
        np.testing.assert_array_equal(parts.values[name], value, err_msg=name)
