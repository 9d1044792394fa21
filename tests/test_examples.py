"""The examples run, with few steps."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch

from granpinn import reference
from granpinn.data import write_flow
from granpinn.physics.laws import LAWS
from tests.flows import make_flow

EXAMPLES = Path(__file__).parents[1] / "examples"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_residual_in_torch_on_fused_jets() -> None:
    """The loss falls, and the residual is that of nested differentiation."""
    example = load("residual_in_torch")
    params, losses = example.train(60)
    assert sum(losses[-5:]) < 0.5 * sum(losses[:5])

    where = example.points(torch.rand(20), torch.rand(20)).double().requires_grad_()
    params = params.double()
    u = reference.network_value(where, params, *example.NETWORK)[:, 0]
    (first,) = torch.autograd.grad(u.sum(), where, create_graph=True)
    (second,) = torch.autograd.grad(first[:, 0].sum(), where)
    expected = first[:, 2] + u * first[:, 0] - example.NU * second[:, 0]
    found = example.residual(params, where.detach())
    torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-9)


def test_an_inverse_problem_of_another_equation() -> None:
    """The fused jets are those of nested differentiation, and nu comes nearer to the truth."""
    example = load("navier_stokes")
    draw = torch.Generator().manual_seed(3)
    where, params = example.points(30, draw).double(), example.network(1).double()
    pairs = zip(example.fused(params, where), example.nested(params, where), strict=True)
    for own, expected in pairs:
        torch.testing.assert_close(own, expected, rtol=1e-9, atol=1e-9)
    data, nu = example.velocity(where), torch.tensor(-3.0, dtype=torch.float64)
    gradients = []
    for jets in (example.fused, example.nested):
        value = example.loss(params, nu, where, data, jets)
        gradients += torch.autograd.grad(value, params)
    torch.testing.assert_close(gradients[0], gradients[1], rtol=1e-7, atol=1e-9)

    _, found = example.train(100, count=256)
    assert example.NU < found[-1] < 0.7 * found[0]


def test_a_law_of_your_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], figures: Callable[..., None]
) -> None:
    figures("friction_law")
    example = load("own_law")
    write_flow(make_flow(), tmp_path / "flow.h5")
    run = ["--flow", str(tmp_path / "flow.h5"), "--out", str(tmp_path / "run")]
    try:
        result = example.main([*run, "--steps", "20", "--width", "8"])
    finally:
        LAWS.pop("linear", None)
    assert (result.law.name, list(result.parameters)) == ("linear", ["mu_s", "b"])
    assert result.law.curve is not None
    assert "\nb       " in capsys.readouterr().out
    assert (tmp_path / "run" / "figures" / "friction_law.png").exists()
    assert "linear law" in (tmp_path / "run" / "report.html").read_text()
