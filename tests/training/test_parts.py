"""The law on halves of the data: its normal equations against automatic differentiation."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from granpinn import identify, results
from granpinn.data import Flow
from granpinn.kernels.network import NetworkSpec, initial_parameters
from granpinn.physics.constants import Physics
from granpinn.physics.laws import DEFAULT, LAWS, Law
from granpinn.training.boxes import Boxes
from granpinn.training.equations import residuals
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.objective import Member
from granpinn.training.parts import laws_on_parts
from granpinn.training.parts_system import System
from granpinn.training.problem import Problem
from granpinn.training.splits import Halves, Step, quantiles, splits_of
from tests.runs import tiny
from tests.training.test_last_layer import draw

SPEC = NetworkSpec((3, 6, 5, 5), (0.1, 0.2, 0.3), (1.1, 0.9, 0.7), "mixed")
PHYSICS = Physics(0.025, 0.05, -1.0, 0.0, math.inf, 0.6, 0.2, 1e-6, 0.8, 0.5, 0.1)
PROBLEM = Problem(SPEC, PHYSICS, [3.0, 5.0, 0.7, 0.4, 0.9], 0.05)
THETA = {"mu_of_i": [0.4, 0.64, 0.3], "coulomb": [0.4]}


def steps() -> list[Step]:
    none = torch.empty(0, dtype=torch.float64)
    value = lambda *v: torch.tensor(v, dtype=torch.float64)  # noqa: E731
    return [
        Step(2, none, value(0.5), value(0.0)),
        Step(1, value(0.4), value(0.5, 0.6), value(0.2, 0.3)),
    ]


def residual_vector(x: Tensor, k: int, sums: Sums, at: Unknowns, halves: Halves) -> Tensor:
    """All weighted residuals at the unknowns x of one split, without code of `System`."""
    F, L = at.C.shape[1], len(sums.free)
    C = at.C + x[: 5 * F].view(5, F)
    own = x[5 * F : -2 * L].view(3, F) if halves.step is not None else None
    base, delta = x[-2 * L : -L], x[-L:]

    def z_of(h: Tensor, points: Tensor) -> Tensor:
        z = h @ C.T
        if own is None or halves.step is None:
            return z
        step, leaf = halves.step, points.double().clone().requires_grad_()
        value = step.jet(leaf)[0]
        jets = [value[:, None] * h[0]]
        if len(h) > 1:
            slope = torch.zeros_like(leaf)
            if step.axis < 2:
                (slope,) = torch.autograd.grad(value.sum(), leaf)
            value = value.detach()
            for i in range(1, 6):
                axis = (None, 0, 1, 2, 0, 1)[i]
                by = slope[:, axis] if axis is not None and axis < 2 else torch.zeros_like(value)
                jets.append(value[:, None] * h[i] + by[:, None] * h[0])
        more = torch.stack(jets).detach() @ own.T
        return torch.cat([z[..., :2], z[..., 2:] + more], -1)

    assert sums._law_weights is not None
    found, first = [], 0
    for h in sums.h:
        n = h.shape[1]
        rows = slice(first, first + n)
        first += n
        theta = at.theta.expand(n, -1).clone()
        second = halves.second[rows].double()[:, None]
        theta[:, sums.free] = theta[:, sums.free] + base + second * delta
        e, _ = residuals(z_of(h, sums.data.points[rows]), theta, sums.physics, sums.law)
        w = sums._weights[rows].clone()
        w[:, 3:] *= sums._law_weights[rows, None]
        found.append((e * w).flatten())
    z = z_of(sums.h_surface[None], sums.data.surface_points)
    p = PHYSICS.pressure_scale * torch.nn.functional.softplus(z[0, :, 2])
    found.append((p - sums.data.surface_pressure) * sums._surface)
    return torch.cat(found)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
@pytest.mark.parametrize("k", [0, 1, 2])
def test_normal_equations_are_those_of_automatic_differentiation(
    seed: int, law: Law, k: int
) -> None:
    if law.name not in THETA:
        THETA[law.name] = [p.typical for p in law.parameters]
    params, data = initial_parameters(SPEC, seed), draw(seed, points=70, surface=9)
    features = Features(SPEC, params)
    chosen = choose(data, features, seed, 0)
    sums = Sums(features, PROBLEM, law, chosen)
    at = Unknowns(coefficients(SPEC, params), torch.tensor(THETA[law.name], dtype=torch.float64))
    sums.loss(at)
    splits = [
        Halves("time", chosen.points[:, 2] > 0.5, steps()[0]),
        Halves("height", chosen.points[:, 1] > 0.5, steps()[1]),
        Halves("rate", torch.arange(len(chosen.points)) % 2 == 0, None),
    ]
    system = System(sums, at, splits)
    with torch.enable_grad():
        system.add_equations()
    i = system._places(k)
    x = torch.zeros(len(i), dtype=torch.float64)
    r = residual_vector(x, k, sums, at, splits[k])
    J = torch.autograd.functional.jacobian(lambda x: residual_vector(x, k, sums, at, splits[k]), x)
    A, b = J.T @ J, J.T @ r
    F, (_, slope, h_h) = at.C.shape[1], sums.misfit(at)
    for u in (0, 1):
        own = slice(u * F, (u + 1) * F)
        A[own, own] += sums.velocity_weight * h_h
        b[own] += slope[u]
    torch.testing.assert_close(system.A[i[:, None], i], A, rtol=1e-9, atol=1e-12)
    torch.testing.assert_close(system.b[i], b, rtol=1e-9, atol=1e-12)
    assert float(b[-len(sums.free) :].abs().max()) > 0


def test_boxes_sum_up_to_the_conditions_of_the_minimum(seed: int) -> None:
    """Over all boxes, Q (r + J x) = Q (b + A x), which is 0 but for the ridge on C."""
    params, data = initial_parameters(SPEC, seed), draw(seed, points=400, surface=40)
    features = Features(SPEC, params)
    sums = Sums(features, PROBLEM, DEFAULT, choose(data, features, seed, 0))
    at = Unknowns(coefficients(SPEC, params), torch.tensor(THETA["mu_of_i"], dtype=torch.float64))
    sums.loss(at)
    halves = Halves("time", sums.data.points[:, 2] > 0.5, steps()[0])
    system = System(sums, at, [halves])
    with torch.enable_grad():
        system.add_equations()
    solved = system.solve(0)
    assert solved is not None
    boxes = Boxes(data.lower, data.upper, 2)
    ((large,),) = system.influence([0], [solved], [boxes])
    x, Q = solved
    i = system._places(0)
    expected = Q.T @ (system.b[i] + system.A[i[:, None], i] @ x)
    torch.testing.assert_close(large.sum(0).flatten(), expected, rtol=1e-6, atol=1e-9)
    assert large.shape == (8, 2, 2)
    assert float(large.abs().sum(0).min()) > 1e3 * float(expected.abs().max())


def test_steps_have_their_slopes(seed: int) -> None:
    points = torch.rand(200, 3, dtype=torch.float64, generator=torch.manual_seed(seed))
    for step in steps():
        leaf = points.clone().requires_grad_()
        value = step.jet(leaf)
        assert value[0].min() >= 0
        assert value[0].max() <= 1
        if step.axis < 2:
            (slope,) = torch.autograd.grad(value[0].sum(), leaf)
            torch.testing.assert_close(value[1:].detach(), slope[:, :2].T)
        else:
            assert set(value[0].tolist()) == {0.0, 1.0}


def test_halves_hold_half_of_what_the_points_tell(seed: int) -> None:
    g = torch.manual_seed(seed)
    points = torch.rand(20000, 3, dtype=torch.float64, generator=g)
    points[:, 1] *= 1 + points[:, 2]  # grains rise
    told = torch.rand(20000, dtype=torch.float64, generator=g) * points[:, 0]
    rate = torch.rand(20000, dtype=torch.float64, generator=g)
    found = splits_of(points, rate, told, (True, True, True))
    assert [halves.name for halves in found] == ["time", "rate", "height", "side"]
    for halves in found:
        share = float(told[halves.second].sum() / told.sum())
        assert share == pytest.approx(0.5, abs=0.01)
        if halves.name != "time":  # at all times
            late = points[:, 2] > 0.8
            share = float(told[halves.second & late].sum() / told[late].sum())
            assert share == pytest.approx(0.5, abs=0.03)


def test_flows_are_not_split_where_they_do_not_change(seed: int) -> None:
    points = torch.rand(500, 3, dtype=torch.float64, generator=torch.manual_seed(seed))
    one = torch.ones(500, dtype=torch.float64)
    rate = points[:, 0]
    names = lambda *changes: [h.name for h in splits_of(points, rate, one, changes)]  # noqa: E731
    assert names(True, True, False) == ["rate", "height", "side"]
    assert names(False, True, True) == ["time", "rate", "height"]


def test_quantiles_are_weighted() -> None:
    values = torch.tensor([3.0, 1.0, 2.0], dtype=torch.float64)
    weights = torch.tensor([8.0, 1.0, 1.0], dtype=torch.float64)
    assert quantiles(values, weights, [0.05, 0.15, 0.5]).tolist() == [1.0, 2.0, 3.0]


def test_every_training_compares_parts_and_keeps_its_law(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = identify(flow, tiny(), run_dir=tmp_path)
    assert result.parts is not None
    assert [split.name for split in result.parts.splits] == ["time", "rate", "height", "side"]
    read = results.read_results(tmp_path / "results.json")
    assert read.parts == result.parts
    monkeypatch.setattr("granpinn.identification.judgement.laws_on_parts", lambda *_: [])
    without = identify(flow, tiny())
    assert without.parts is None
    assert without.parameters == result.parameters


def test_runs_without_the_last_layer_step_have_no_parts(flow: Flow) -> None:
    assert identify(flow, tiny(optimizer__last_layer=False)).parts is None
    assert identify(flow, tiny(form="strong")).parts is None


def test_laws_on_parts_are_a_function_of_their_arguments(seed: int) -> None:
    params, data = initial_parameters(SPEC, seed), draw(seed, points=3000)
    theta = torch.tensor(THETA["mu_of_i"], dtype=torch.float64)
    member = Member(PROBLEM, data, seed, DEFAULT, {"I0": 0.3})
    found = laws_on_parts(member, params, theta, 0)
    again = laws_on_parts(member, params, theta, 0)
    assert [half.name for half in found] == ["time", "rate", "height", "side"]
    for one, two in zip(found, again, strict=True):
        assert torch.equal(one.theta, two.theta)
        assert float(one.share.sum()) == pytest.approx(1)
        assert bool((one.I[:, 0] < one.I[:, 1]).all())
