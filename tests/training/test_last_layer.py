"""The last-layer step: it has the loss of the training, and is exact for linear problems."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from granpinn import identify
from granpinn.data import Flow
from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec, initial_parameters, layer_offsets
from granpinn.physics.constants import Physics
from granpinn.physics.laws import DEFAULT, LAWS
from granpinn.training import equations
from granpinn.training import last_layer as module
from granpinn.training.equations import law_weights
from granpinn.training.features import Features, coefficients, with_coefficients
from granpinn.training.last_layer import ITERATIONS, factor, improve, iterate, last_layer
from granpinn.training.last_layer_sums import Data, Sums, Unknowns, choose, velocity_moments
from granpinn.training.objective import Member
from granpinn.training.points import TrainingSet
from granpinn.training.problem import Problem
from tests.runs import tiny

SPEC = NetworkSpec((3, 9, 7, 5), (0.1, 0.2, 0.3), (1.1, 0.9, 0.7), "mixed")

THETA = torch.tensor([0.4, 0.64, 0.3], dtype=torch.float64)

WEIGHTS = [3.0, 5.0, 0.7, 0.4, 0.9]

PHYSICS = Physics(0.025, 0.05, -1.0, 0.0, math.inf, 0.6, 0.2, 1e-6, 0.8, 0.5, 0.1, 0.7)
SCALES = torch.tensor(PHYSICS.velocity_scales, dtype=torch.float64)


def problem(*weights: float) -> Problem:
    return Problem(SPEC, PHYSICS, list(weights or WEIGHTS), 0.0)


def draw(seed: int, points: int = 3000, surface: int = 200) -> TrainingSet:
    """Random data with more points than a chunk has."""
    g = torch.Generator().manual_seed(seed)
    rand = lambda *shape: torch.rand(*shape, generator=g, dtype=torch.float64)  # noqa: E731
    x, velocity, weights = rand(points, 3), rand(points, 2), 0.5 + rand(points, 2)
    surface_points, pressure = rand(surface, 3), rand(surface)
    bounds = (x.amin(0), x.amax(0))
    none = (x[:0], x[:0], x[:0, 0], x[:0], velocity[:0])
    return TrainingSet(x, velocity, weights, surface_points, pressure, *bounds, *none)


def every_point(data: TrainingSet, features: Features) -> Data:
    """All points once, in their order."""
    measured = (data.points, data.velocity, data.point_weights[:, 0])
    moments, weights = velocity_moments(features, *measured), data.point_weights[:, 1]
    of_surface = (data.surface_points, data.surface_pressure)
    rest = (moments, measured, data.lower[1], data.source)
    return Data(data.points, weights, *of_surface, *rest)


def sums_of(posed: Problem, data: TrainingSet, params: Tensor) -> Sums:
    features = Features(posed.spec, params, posed.window)
    return Sums(features, posed, DEFAULT, every_point(data, features))


@pytest.fixture
def long_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """For networks that are hardly trained."""
    monkeypatch.setattr(module, "LONGEST", 3)


def unweighted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equations, "law_weights", lambda p, gamma_dot: torch.ones_like(p))


@pytest.mark.parametrize("sourced", [False, True])
def test_loss_and_gradient_are_those_of_the_fused_loss(
    sourced: bool, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    unweighted(monkeypatch)
    params, data = initial_parameters(SPEC, seed), draw(seed)
    if sourced:
        data = dataclasses.replace(data, source=data.velocity.flip(0))
    at = Unknowns(coefficients(SPEC, params), THETA)
    sums = sums_of(problem(), data, params)
    weights = torch.tensor(WEIGHTS, dtype=torch.float64)
    loss, _, by_params, by_theta = ops.residual_loss(
        params, THETA, data.loss_points, weights, SPEC, PHYSICS
    )
    assert sums.loss(at) == pytest.approx(float(loss), rel=1e-12)
    A, b = sums.normal_equations(at)
    last = by_params[layer_offsets(SPEC.widths)[-1] :]
    by_C = torch.cat([last[:35].view(5, 7), last[35:, None]], 1)
    torch.testing.assert_close(b[:40], by_C.flatten(), rtol=1e-9, atol=1e-12)
    torch.testing.assert_close(b[-2:], by_theta[:2], rtol=1e-9, atol=1e-12)
    assert float((A - A.T).abs().max()) <= 1e-12 * float(A.abs().max())


def test_vectors_are_means_over_their_window_to_fourth_order(seed: int) -> None:
    params, points = initial_parameters(SPEC, seed), draw(seed, points=50).points
    place = (torch.arange(16, dtype=torch.float64) + 0.5) / 16 - 0.5
    grid = torch.cartesian_prod(place, place, place.new_zeros(1))
    errors = []
    for window in (0.4, 0.2):
        features = Features(SPEC, params, window)
        exact = torch.stack([features.jet(points + window * g, 0)[0] for g in grid]).mean(0)
        errors.append(float((features.of_vectors(points) - exact).abs().max()))
    middle = Features(SPEC, params).of_vectors(points)
    assert errors[1] < errors[0] / 8  # 1/16, and that of the sum over 16 x 16 places
    assert errors[1] < 0.1 * float((middle - exact).abs().max())


@pytest.mark.parametrize("window", [0.0, 0.3])
def test_a_step_finds_the_exact_solution_of_a_linear_problem(seed: int, window: float) -> None:
    """The velocity of other coefficients of u and v, measured in windows or at points."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    C = coefficients(SPEC, params)
    g = torch.Generator().manual_seed(seed + 1)
    C[:2] += torch.randn(2, 8, generator=g, dtype=torch.float64)
    h = Features(SPEC, params, window).of_vectors(data.points)
    data = dataclasses.replace(data, velocity=h @ C[:2].T * SCALES)
    # So little of the rest that it only makes the other unknowns unknowns of the problem.
    posed = dataclasses.replace(problem(1, 1e-14, 1e-14, 1e-14, 1e-14), window=window)
    sums = sums_of(posed, data, params)
    start = Unknowns(coefficients(SPEC, params), THETA)
    A, b = sums.normal_equations(start)
    found = factor(A, 2, ridge=1e-13)
    assert found is not None
    x = found.solve(-b)
    torch.testing.assert_close(start.C[:2] + x[:16].view(2, 8), C[:2], rtol=1e-5, atol=1e-5)


def slope() -> tuple[Problem, Tensor]:
    r"""A uniform shear down a slope, u = y, p = cos(a) (1.2 - y), tau_xy = tan(a) p, and its C.

    No term has a residual if mu(I) = tan(a) at all I, so at mu_s = mu_2 = tan(a); a network without
    hidden layers has these fields, where softplus is as good as its argument.
    """
    spec = NetworkSpec((3, 5), (0, 0, 0), (1, 1, 1), "mixed")
    sin, cos, U, P = math.sin(0.4), math.cos(0.4), 0.5, 0.005
    physics = Physics(0.3, sin, -cos, 0, math.inf, U, P, 1e-6)
    posed = Problem(spec, physics, [1e4, 1e4, 400, 40, 40], 0.1)
    C = torch.zeros(5, 4, dtype=torch.float64)  # of x, y, t and 1
    C[0, 1], C[2, 1], C[2, 3], C[4, 3] = 1 / U, -cos / P, 1.2 * cos / P, sin / cos
    return posed, C


def test_steps_end_at_an_exact_solution(seed: int) -> None:
    """From other unknowns a few steps come there, and stay."""
    posed, C = slope()
    data, friction = draw(seed), math.tan(0.4)
    data = dataclasses.replace(
        data,
        velocity=data.points[:, 1:2] * data.points.new_tensor([1.0, 0.0]),
        surface_pressure=math.cos(0.4) * (1.2 - data.surface_points[:, 1]),
    )
    generator = torch.Generator().manual_seed(seed)
    noise = 1 + 0.02 * torch.randn(5, 4, generator=generator, dtype=torch.float64)
    params = with_coefficients(posed.spec, torch.zeros(20, dtype=torch.float64), C)
    sums = sums_of(posed, data, params)
    exact = Unknowns(C, THETA.new_tensor([friction, friction, 0.3]))
    assert sums.loss(exact) < 1e-20  # gamma_dot is 1 + SMOOTHING / 2
    at, off = Unknowns(C * noise, THETA.new_tensor([0.41, 0.44, 0.3])), []
    for _ in range(8):
        A, b = sums.normal_equations(at)
        found = factor(A, 2)
        assert found is not None
        x = found.solve(-b)
        theta = at.theta + torch.cat([x[-2:], x.new_zeros(1)])
        at = Unknowns(at.C + x[:-2].view_as(C), theta)
        off.append(float((at.theta - exact.theta).norm()))
    assert off[-1] < 1e-6, off


def test_law_weights_fall_where_the_pressure_is_small() -> None:
    p = torch.tensor([0.3, 0.15, 0.1, 1e-9], dtype=torch.float64)
    w = law_weights(p, torch.full_like(p, 3.0))
    assert w[2] == pytest.approx(2**-0.5)  # gamma_dot delta p / p = sigma
    assert bool((w.diff() < 0).all())
    assert 0 < w[3] < 1e-7


def test_a_step_lowers_the_loss_and_is_short(seed: int) -> None:
    """Far from a solution the law does not move by more than a tenth, or nothing moves."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    sums = sums_of(problem(), data, params)
    start = Unknowns(coefficients(SPEC, params), THETA)
    found = improve(sums, start)
    moved = (found.theta / start.theta - 1).abs()
    assert float(moved.max()) <= module.LONGEST + 1e-12
    assert sums.loss(found) < sums.loss(start) or found is start
    broken = Unknowns(start.C * math.nan, start.theta)
    assert improve(sums_of(problem(), data, params), broken) is broken


def test_steps_are_repeated_until_the_law_has_settled(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every step from where the one before it ended, with weights of its own; a curve has one."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    sums, start = sums_of(problem(), data, params), Unknowns(coefficients(SPEC, params), THETA)
    left = [0.9, 1.05, 1 + 0.9 * module.SETTLED, 0.5]
    seen: list[tuple[float, bool]] = []

    def step(sums: Sums, at: Unknowns) -> Unknowns:
        seen.append((float(at.theta[0]), sums._kept is None))
        sums.loss(at)
        return Unknowns(at.C, at.theta * left[len(seen) - 1])

    monkeypatch.setattr(module, "improve", step)
    found = iterate(sums, start)
    assert seen == [(pytest.approx(value), True) for value in (0.4, 0.36, 0.378)]
    assert float(found.theta[0]) == pytest.approx(0.378 * left[2])
    seen.clear()
    left[:] = [0.9] * 20
    iterate(sums, start)
    assert len(seen) == module.ITERATIONS
    seen.clear()
    sums.law = LAWS["free"]
    monkeypatch.setattr(module, "relative_change", lambda *_: 1.0)
    iterate(sums, start)
    assert len(seen) == 1


def test_points_are_a_function_of_seed_and_step(seed: int) -> None:
    data = draw(seed)
    features = Features(SPEC, initial_parameters(SPEC, seed))
    first, again, other = (choose(data, features, s, 7).points for s in (seed, seed, seed + 1))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
@pytest.mark.usefixtures("long_steps")
def test_cuda_makes_the_step_of_the_cpu(seed: int) -> None:
    (here, law), (there, other) = solved_on("cpu", seed), solved_on("cuda", seed)
    torch.testing.assert_close(there.cpu(), here, rtol=1e-6, atol=1e-8)
    torch.testing.assert_close(other.cpu(), law, rtol=1e-7, atol=0)


def solved_on(device: str, seed: int) -> tuple[Tensor, Tensor]:
    """Parameters and law after a step towards the velocity of a network with another last layer."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    other = with_coefficients(SPEC, params, 1.1 * coefficients(SPEC, params))
    network = (SPEC.widths, SPEC.input_shift, SPEC.input_scale)
    velocity = SCALES * ops.network_value(data.points, other, *network)[:, :2]
    data = dataclasses.replace(data, velocity=velocity)
    tensors = {name: value.to(device) for name, value in data.arrays().items()}
    posed = problem(1, 1e-9, 1e-9, 1e-9, 1e-9)
    moved = TrainingSet(**tensors)
    member = Member(posed, moved, seed, DEFAULT, {})
    return last_layer(member, params.to(device), THETA.to(device), 3)


@pytest.mark.usefixtures("long_steps")
def test_a_run_ends_with_the_step(tmp_path: Path, flow: Flow) -> None:
    """The values are those after it; history and residuals are those of the steps."""
    config = tiny(steps=100)
    with_step = identify(flow, config, run_dir=tmp_path / "run")
    optimizer = dataclasses.replace(config.optimizer, last_layer=False)
    without = identify(flow, dataclasses.replace(config, optimizer=optimizer))
    row = (tmp_path / "run" / "history.csv").read_text().splitlines()
    last = dict(zip(row[0].split(","), map(float, row[-1].split(",")), strict=True))
    assert without.parameters.mu_s.value == pytest.approx(last["mu_s"], rel=1e-6)
    assert with_step.parameters.mu_s.value != without.parameters.mu_s.value
    assert with_step.residuals == without.residuals
    again = identify(flow, dataclasses.replace(config, resume=True), run_dir=tmp_path / "run")
    assert again.parameters == with_step.parameters


def test_a_time_limit_leaves_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of 10 s: a further one is made only if it ends in time."""
    now, made = 100.0, []

    def improve(sums: Sums, at: Unknowns) -> Unknowns:
        nonlocal now
        now += 10.0
        made.append(now)
        return Unknowns(at.C, at.theta * 1.05)

    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    monkeypatch.setattr(module, "improve", improve)
    params = initial_parameters(SPEC, 0)
    for until, steps in ((-math.inf, 1), (111.0, 1), (125.0, 2), (math.inf, ITERATIONS)):
        now = 100.0
        made.clear()
        start = Unknowns(coefficients(SPEC, params), THETA)
        iterate(sums_of(problem(), draw(0), params), start, until)
        assert len(made) == steps
