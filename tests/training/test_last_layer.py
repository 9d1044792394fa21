"""The last solve: the same loss as training, exact where the problem is linear, a whole run."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import get_args

import pytest
import torch
from torch import Tensor

from bench import last_layer
from bench.last_layer_solve import (
    Data,
    Features,
    LastLayer,
    LawWeight,
    law_weights,
    normal_equations,
    pressure,
    step,
)
from granpinn import identify, identify_many, ops
from granpinn.data import Flow
from granpinn.network import NetworkSpec, initial_parameters, layer_offsets
from granpinn.training.problem import Problem
from tests.training.conftest import tiny

SPEC = NetworkSpec((3, 9, 7, 5), (0.1, 0.2, 0.3), (1.1, 0.9, 0.7), "mixed")
THETA = torch.tensor([0.4, 0.64, 0.3], dtype=torch.float64)
WEIGHTS = [3.0, 5.0, 0.7, 0.4, 0.9]
PHYSICS = [0.025, 0.05, -1.0, 0.0, math.inf, 0.6, 0.2, 1e-6]


def problem(*weights: float) -> Problem:
    return Problem(SPEC, PHYSICS, list(weights or WEIGHTS))


def draw(seed: int, points: int = 3000, surface: int = 200) -> tuple[Tensor, Features, Data]:
    """A random network, and random data with more points than a chunk has."""
    g = torch.Generator().manual_seed(seed)
    rand = lambda *shape: torch.rand(*shape, generator=g, dtype=torch.float64)  # noqa: E731
    params = initial_parameters(SPEC, seed)
    data = Data(
        rand(points, 3), rand(points, 2), 0.5 + rand(points, 2), rand(surface, 3), rand(surface)
    )
    return params, Features(SPEC, params, THETA), data


def test_loss_and_gradient_are_those_of_the_fused_loss(seed: int) -> None:
    params, features, data = draw(seed)
    normal = normal_equations(features, features.start, problem(), data, "none")
    rest = (SPEC.widths, SPEC.input_shift, SPEC.input_scale, PHYSICS, "mixed")
    weights = torch.tensor(WEIGHTS, dtype=torch.float64)
    loss, _, by_params, by_theta = ops.residual_loss(
        params, THETA, *vars(data).values(), weights, *rest
    )
    assert normal.loss == pytest.approx(float(loss), rel=1e-12)
    last = by_params[layer_offsets(SPEC.widths)[-1] :]
    by_C = torch.cat([last[:35].view(5, 7), last[35:, None]], 1)
    torch.testing.assert_close(normal.b[: 5 * 8], by_C.flatten(), rtol=1e-9, atol=1e-12)
    torch.testing.assert_close(normal.b[-2:], by_theta[:2], rtol=1e-9, atol=1e-12)


def test_a_step_finds_the_exact_solution_of_a_linear_problem(seed: int) -> None:
    """Velocity and surface pressure of other coefficients of u, v and the pressure's own part."""
    _, features, data = draw(seed)
    C = features.start.C.clone()
    g = torch.Generator().manual_seed(seed + 1)
    C[[0, 1, 5]] += torch.randn(3, 8, generator=g, dtype=torch.float64)
    inside, surface = (features.jet(x) @ C.T for x in (data.points, data.surface_points))
    data = dataclasses.replace(
        data,
        velocity=PHYSICS[5] * inside[0, :, :2],
        surface_pressure=pressure(surface, PHYSICS)[0],
    )
    # So little of the equations that they only make mu_s and mu_2 unknowns of the problem.
    made = step(features, features.start, problem(1, 1, 1e-14, 1e-14, 1e-14), data, ridge=1e-13)
    torch.testing.assert_close(made.unknowns.C[:2], C[:2], rtol=1e-5, atol=1e-5)
    assert made.loss_after < 1e-10 * made.loss


@pytest.mark.parametrize("law_weight", get_args(LawWeight))
def test_steps_end_at_an_exact_solution(law_weight: LawWeight, seed: int) -> None:
    r"""A uniform shear down a slope, u = y, p = cos(a) (1.2 - y), tau_xy = tan(a) p.

    No term has a residual if mu(I) = tan(a) at all I, so at mu_s = mu_2 = tan(a); a network without
    hidden layers has these fields. From other unknowns a few steps come there, and stay.
    """
    _, _, data = draw(seed)
    spec = NetworkSpec((3, 5), (0, 0, 0), (1, 1, 1), "mixed")
    sin, cos = math.sin(0.4), math.cos(0.4)
    U, P = 0.5, 0.2
    posed = Problem(spec, [0.3, sin, -cos, 0, math.inf, U, P, 1e-6], [1e4, 1e4, 400, 40, 40])
    data = dataclasses.replace(
        data,
        velocity=data.points[:, 1:2] * data.points.new_tensor([1.0, 0.0]),
        surface_pressure=cos * (1.2 - data.surface_points[:, 1]),
    )
    # of x, y, t and 1, for u, v, the argument of softplus, s_1, s_2 and p itself
    C = torch.zeros(6, 4, dtype=torch.float64)
    C[0, 1], C[2, 3], C[4, 3], C[5, 1] = 1 / U, -3, sin / cos, -cos / P
    C[5, 3] = 1.2 * cos / P - math.log1p(math.exp(-3))
    exact = LastLayer(C, THETA.new_tensor([sin / cos, sin / cos, 0.3]))
    features = Features(spec, torch.zeros(20, dtype=torch.float64), THETA)
    stays = step(features, exact, posed, data, law_weight)
    assert stays.loss < 1e-20  # gamma_dot is 1 + SMOOTHING / 2
    torch.testing.assert_close(stays.unknowns.theta, exact.theta, rtol=1e-9, atol=0)
    generator = torch.Generator().manual_seed(seed)
    noise = torch.randn(6, 4, generator=generator, dtype=torch.float64)
    at, off = LastLayer(C + 0.02 * noise, THETA.new_tensor([0.3, 0.6, 0.3])), []
    for _ in range(8):
        at = step(features, at, posed, data, law_weight).unknowns
        off.append(float((at.theta - exact.theta).norm()))
    assert off[-1] < 1e-6, off


def test_law_weights_fall_where_the_pressure_is_small() -> None:
    p = torch.tensor([0.3, 0.15, 0.1, 1e-9], dtype=torch.float64)
    gamma_dot = torch.full_like(p, 3.0)
    assert law_weights("none", p, gamma_dot).tolist() == [1, 1, 1, 1]
    torch.testing.assert_close(law_weights("p", p, gamma_dot), p / 0.15)
    depth = law_weights("depth", p, gamma_dot)
    assert depth[2] == pytest.approx(2**-0.5)  # gamma_dot delta / p = sigma
    assert bool((depth.diff() < 0).all())
    assert depth[3] < 1e-7


def test_the_command_on_a_run_and_on_a_batch(tmp_path: Path, flow: Flow, flow_file: Path) -> None:
    identify(flow_file, tiny(members=2), run_dir=tmp_path / "run")
    identify_many([flow_file] * 2, tiny(), [3, 4], run_dir=tmp_path / "batch", keep_fields=False)
    out = tmp_path / "rows.json"
    runs = [str(tmp_path / "run"), str(tmp_path / "batch"), "--flows", str(flow_file)]
    assert last_layer.main([*runs, "--points", "0", "--json", str(out)]) == 0
    rows = json.loads(out.read_text())["rows"]
    found = [json.loads((tmp_path / "batch" / f"00{e}/results.json").read_text()) for e in (0, 1)]
    alone = json.loads((tmp_path / "run/results.json").read_text())
    assert [row["seed"] for row in rows[2:]] == [3, 4]
    for name in ("mu_s", "mu_2"):
        values = [row[f"{name}_trained"] for row in rows]
        assert values[:2] == pytest.approx(alone["members"][name])
        assert values[2:] == pytest.approx([f["parameters"][name]["value"] for f in found])
    for row in rows:
        assert row["points"] == alone["data"]["n_points"]
        assert row["loss_after"] < row["loss"]
        true = flow.truth.mu_s if flow.truth else None
        assert row["mu_s_solved_error_percent"] == pytest.approx(
            100 * (row["mu_s_solved"] / true - 1)
        )
    assert (
        last_layer.main([*runs, "--points", "0", "--without-bottom-row", "--json", str(out)]) == 0
    )
    lowest = flow.valid[flow.t > 0][:, 0].sum()
    assert json.loads(out.read_text())["rows"][0]["points"] == rows[0]["points"] - lowest


def test_what_is_missing_is_said(
    tmp_path: Path, flow_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    identify_many([flow_file], tiny(), run_dir=tmp_path / "batch", keep_fields=False)
    assert last_layer.main([str(tmp_path / "batch")]) == 2
    assert "give that file with --flows" in capsys.readouterr().err
    assert last_layer.main([str(tmp_path)]) == 2
    assert "has no checkpoint" in capsys.readouterr().err
