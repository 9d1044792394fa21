"""The study of the floor: its flows are exact, and it runs."""

from __future__ import annotations

import json
import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
import torch
from torch import Tensor

from bench.studies.floor import run, start_up
from bench.studies.floor.fields import (
    END,
    GRAIN,
    KINDS,
    PHYSICS,
    THETA,
    WIDTH,
    T,
    X,
    Y,
    exact,
    expressions,
)
from bench.studies.floor.sampling import Sampling, sample
from granpinn.arrays import Float64
from granpinn.fit.case import pose
from granpinn.kernels import ops
from tests.runs import tiny


@cache
def places(name: str, n: int = 300) -> tuple[Float64, Float64, Float64]:
    """Random points among the grains."""
    rng = np.random.default_rng(3)
    x, t = rng.uniform(0, WIDTH, n), rng.uniform(0, END, n)
    return x, rng.uniform(0.01, 0.97, n) * exact(name).height(x, t), t


def slope(value: Tensor, points: Tensor) -> list[Tensor]:
    (found,) = torch.autograd.grad(value.sum(), points, create_graph=True)
    return list(found.unbind(1))


@pytest.mark.parametrize("name", KINDS)
def test_the_source_is_what_the_momentum_equation_lacks(name: str) -> None:
    """By nested automatic differentiation of the stream function, without any kernel."""
    x, y, t = places(name)
    points = torch.tensor(np.stack([x, y, t], 1), requires_grad=True)
    functions = {f: getattr(torch, f) for f in ("sin", "cos", "tanh", "cosh", "exp", "log")}
    numbers = [sp.N(part, 17) for part in expressions(name)[:2]]
    psi, p = sp.lambdify((X, Y, T), numbers, modules=[functions])(*points.unbind(1))
    psi_x, psi_y, _ = slope(psi, points)
    u, v = psi_y, -psi_x
    (u_x, u_y, u_t), (v_x, v_y, v_t), (p_x, p_y, _) = (slope(f, points) for f in (u, v, p))
    D_1, D_2 = (u_x - v_y) / 2, (u_y + v_x) / 2
    rate = torch.sqrt(4 * (D_1**2 + D_2**2) + 1e-12)
    mu_s, mu_2, I_0 = THETA
    inertial = GRAIN * rate / torch.sqrt(p.clamp_min(PHYSICS.pressure_floor))
    mu = mu_s + (mu_2 - mu_s) * inertial / (I_0 + inertial)
    tau_1, tau_2 = 2 * mu * p * D_1 / rate, 2 * mu * p * D_2 / rate
    (tau_1_x, tau_1_y, _), (tau_2_x, tau_2_y, _) = slope(tau_1, points), slope(tau_2, points)
    S_x = u_t + u * u_x + v * u_y + p_x - tau_1_x - tau_2_y - PHYSICS.g_x
    S_y = v_t + u * v_x + v * v_y + p_y - tau_2_x + tau_1_y - PHYSICS.g_y
    found = exact(name).source(x, y, t)
    for ours, truth in zip(found, (S_x, S_y), strict=True):
        np.testing.assert_allclose(ours, truth.detach().numpy(), rtol=1e-7, atol=1e-7)
        assert np.abs(ours).max() > 0.1
    np.testing.assert_allclose(exact(name).velocity(x, y, t)[0], u.detach().numpy(), atol=1e-13)
    np.testing.assert_allclose((u_x + v_y).detach().numpy(), 0, atol=1e-10)
    np.testing.assert_allclose(
        exact(name).inertial_number(x, y, t),
        inertial.detach().numpy(),
        rtol=1e-6,
        atol=5e-7,  # the smoothing
    )


def test_grains_on_a_slope_start_as_their_equation_says() -> None:
    """Those that do not shear yet fall with g sin - mu_s g cos; the others solve the equation."""
    u = start_up.velocity(40)
    t = np.linspace(0, start_up.END, 41)
    mu_s, mu_2, I_0 = THETA
    g_x, g_y = math.sin(start_up.SLOPE), math.cos(start_up.SLOPE)
    assert u(0.95)[1] == pytest.approx((g_x - mu_s * g_y) * t[1], rel=2e-3)
    y, e, k = np.linspace(0.1, 0.9, 9), 0.02, 20
    p = g_y * (1 - y[:, None] - np.array([-e, e]))
    rate = u(y[:, None] + np.array([-e, e]), 1)[k]
    I = GRAIN * rate / np.sqrt(p)
    tau = (mu_s + (mu_2 - mu_s) * I / (I_0 + I)) * p
    u_t = (u(y)[k + 1] - u(y)[k - 1]) / (t[k + 1] - t[k - 1])
    np.testing.assert_allclose(u_t, g_x + (tau[:, 1] - tau[:, 0]) / (2 * e), rtol=0.03)


@pytest.mark.parametrize("name", KINDS)
def test_the_exact_fields_solve_the_problem_of_the_training(name: str) -> None:
    """In its units, with its constants, its points and its source: the strong form has no residual.

    The kernels smooth the shear rate by 1e-6 in units of the height, which the training measures.
    """
    case = pose(sample(name, Sampling(cells=12, frames=6)), tiny(dtype="float64"))
    data, scales = case.member.data, case.scales
    assert data.source is not None
    assert scales.length != 1
    points = torch.cat([data.points, data.between, data.strip]).numpy()
    jets = exact(name).jets(*scales.points_to_physical(points).T)
    jets[:, :, :2] /= scales.velocity
    jets[:, :, 2] /= scales.pressure
    jets[[1, 2]] *= scales.length
    jets[3] *= scales.time
    jets[4:] *= scales.length**2
    constants = case.member.problem.physics._replace(velocity_scale=1.0, pressure_scale=1.0)
    theta = torch.tensor(THETA, dtype=torch.float64)
    e = ops.pointwise_residuals(torch.from_numpy(jets), theta, list(constants), "strong")
    left = (e[:, :2] - data.source).abs()
    assert float(left.median()) < 1e-6
    assert float(left.quantile(0.99)) < 1e-4
    np.testing.assert_allclose(e[:, 2].numpy(), 0, atol=1e-10)


def test_the_study_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["--cases", "plug 16", "--seeds", "2", "--device", "cpu", "--steps", "12"]
    words += ["--noises", "0", "0.1"]
    words += ["--network.widths", "9,7", "--batch.interior", "33", "--batch.surface", "6"]
    monkeypatch.setattr(sys, "argv", ["run", *words, "--json", str(tmp_path / "floor.json")])
    assert run.main() == 0
    found = json.loads((tmp_path / "floor.json").read_text())
    assert [(row["noise"], row["seed"]) for row in found["rows"]] == [
        (0, 0),
        (0, 1),
        (0.1, 0),
        (0.1, 1),
    ]
    assert found["rows"][2]["residuals"]["noise"] > 0
    for row in found["rows"]:
        assert row["mu_s_percent"] == pytest.approx(100 * (row["found"]["mu_s"] / 0.4 - 1))
        assert len(row["mu_percent"]) == len(found["I"])
        assert row["failure"] is None
