"""Errors for wrong arguments: their messages have the expected and the given value."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch

from .configurations import Problem, problem, small
from .devices import device_of, moved
from .op_inputs import operands

N, M = 33, 5  # of the mixed problem below; its network has P parameters
CASE = problem(small("mixed", source=True))
POINTS = CASE.batch
P = len(CASE.params)

WRONG: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "half precision": (
        {"params": CASE.params.half()}, TypeError, r"params.*float32 or float64.*Half"),
    "other precision": (
        {"points": POINTS.points.float()}, TypeError, r"points.*params.*Float"),
    "integers": ({"velocity": torch.zeros(N, 2, dtype=torch.int64)}, TypeError, "velocity.*Long"),
    "too few parameters": (
        {"params": CASE.params[:-1]}, ValueError, rf"params.*\[{P}\].*\[{P - 1}\]"),
    "widths of another network": (
        {"widths": [3, 7, 5]}, ValueError, rf"params.*\[{3 * 7 + 7 + 7 * 5 + 5}\].*\[{P}\]"),
    "two inputs": ({"widths": [2, 17, 8, 5]}, ValueError, r"widths.*3.*\[2, 17, 8, 5\]"),
    "an empty layer": ({"widths": [3, 0, 5]}, ValueError, r"widths.*\[3, 0, 5\]"),
    "no layer": ({"widths": [3]}, ValueError, r"widths.*\[3\]"),
    "two shifts": ({"input_shift": CASE.params.new_zeros(2)}, ValueError, r"input_shift.*3.*2"),
    "points of a plane": (
        {"points": POINTS.points[:, :2]}, ValueError, rf"points.*\[N, 3\].*\[{N}, 2\]"),
    "ensemble of points": (
        {"points": POINTS.points.expand(2, N, 3)}, ValueError, rf"points.*\[2, {N}, 3\]"),
    "theta without I_0": ({"theta": CASE.theta[:2]}, ValueError, r"theta.*\[3\].*\[2\]"),
    "velocity of other points": (
        {"velocity": POINTS.velocity[1:]}, ValueError, rf"velocity.*\[{N}, 2\].*\[{N - 1}, 2\]"),
    "one weight a point": (
        {"point_weights": POINTS.point_weights[:, 0]}, ValueError, rf"point_weights.*\[{N}, 2\]"),
    "surface points of a plane": (
        {"surface_points": POINTS.surface_points[:, :2]}, ValueError, r"surface_points.*\[N, 3\]"),
    "pressure elsewhere": (
        {"surface_pressure": POINTS.surface_pressure[1:]}, ValueError,
        rf"surface_pressure.*\[{M}\].*\[{M - 1}\]"),
    "four terms": ({"term_weights": CASE.term_weights[:4]}, ValueError, r"\[5\].*\[4\]"),
    "eight numbers": (
        {"physics": CASE.params.new_tensor(CASE.physics[:8])}, ValueError,
        r"physics.*side_wall_speed.*8"),
    "source of other points": (
        {"source": POINTS.velocity[1:]}, ValueError, rf"source.*\[{N}, 2\].*\[{N - 1}, 2\]"),
    "source of another type": (
        {"source": POINTS.velocity.float()}, TypeError, "source must have the type and device of"),
    "a source that learns": (
        {"source": POINTS.velocity.clone().requires_grad_()}, ValueError,
        "source must not require a gradient"),
    "another form": ({"form": "weak"}, ValueError, "'mixed', 'strong' or 'data', got 'weak'"),
    "five fields in the strong form": ({"form": "strong"}, ValueError, "strong.*3.*5"),
}  # fmt: skip


# On a GPU the constants of a batch are data of the device, which no check waits for.
WRONG_VALUES: dict[str, Any] = {
    "walls that push": ((-0.1, 0.2), "side_wall must not be negative"),
    "walls without a speed": ((0.1, 0.0), "side_wall_speed must be positive, got 0.1"),
}


@pytest.mark.parametrize("name", WRONG_VALUES)
def test_wrong_side_walls_on_a_cpu(name: str, cpu_ops: ModuleType) -> None:
    walls, message = WRONG_VALUES[name]
    with pytest.raises(ValueError, match=f"(?s){message}"):
        cpu_ops.residual_loss(*CASE._replace(physics=[*CASE.physics[:9], *walls, 1.0]))


def residual_loss(ops: ModuleType, change: dict[str, Any]) -> Any:
    """Of the case with a change, by the names of the operator."""
    inputs = operands(CASE) | change
    there = {name: moved(x, device_of(ops)) for name, x in inputs.items()}
    return torch.ops.granpinn.residual_loss(**there)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_argument_of_the_loss(name: str, ops: ModuleType) -> None:
    change, error, message = WRONG[name]
    with pytest.raises(error, match=f"(?s){message}"):
        residual_loss(ops, change)


def test_ensemble_of_another_size(ops: ModuleType) -> None:
    case: Problem = problem(small("mixed", members=2))
    with pytest.raises(ValueError, match=r"(?s)theta.*E = 2.*\[3, 3\]"):
        ops.residual_loss(*case._replace(theta=torch.ones(3, 3, dtype=torch.float64)))


@pytest.mark.parametrize(
    ("shape", "form", "message"),
    [
        ((4, 6, 4), "mixed", r"\[4, N, 5\].*\[4, 6, 4\]"),
        ((4, 6, 3), "strong", r"\[7, N, 3 or 5\].*\[4, 6, 3\]"),
        ((7, 6), "strong", r"\[7, N, 3 or 5\].*\[7, 6\]"),
        ((4, 6, 5), "data", "'mixed' or 'strong', got 'data'"),
    ],
)
def test_raw_jets(shape: tuple[int, ...], form: str, message: str, ops: ModuleType) -> None:
    jets = torch.zeros(shape, dtype=torch.float64)
    with pytest.raises(ValueError, match=message):
        ops.pointwise_residuals(jets, CASE.theta, CASE.physics, form)


@pytest.mark.parametrize("device", ["cpu", "meta"])
def test_shapes_without_data_refuse_what_a_kernel_refuses(device: str) -> None:
    """`torch.compile` asks for the shapes on the device meta before any kernel runs."""
    jets, theta = torch.zeros(4, 2, 5, device=device), CASE.theta.float().to(device)
    with pytest.raises(ValueError, match=r"form must be 'mixed' or 'strong', got 'data'"):
        torch.ops.granpinn.pointwise_residuals(jets, theta, CASE.physics, "data", "mu_of_i")
    points, params = torch.zeros(2, 3, device=device), torch.zeros(20, device=device)
    for order in (3, -1):
        with pytest.raises(ValueError, match=f"order must be 0, 1 or 2, got {order}"):
            torch.ops.granpinn.network_jet(points, params, [3, 5], [0.0] * 3, [1.0] * 3, order)
