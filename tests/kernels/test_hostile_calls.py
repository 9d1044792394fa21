"""Hostile arguments of the operators are refused or answered, and never end the process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from .op_inputs import INPUTS
from .step_inputs import batch_arguments, descend_arguments, update_arguments

CALLS = 60  # of every operator


def test_hostile_calls_do_not_end_the_process(seed: int) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "tests.kernels.hostile_calls", str(seed), str(CALLS)],
        capture_output=True,
        text=True,
        timeout=100,
        cwd=Path(__file__).parents[2],
    )
    assert run.returncode == 0, run.stderr[-3000:]
    outcomes = json.loads(run.stdout)
    assert sum(outcomes.values()) == CALLS * len(INPUTS)
    assert outcomes["ValueError"] > CALLS
    assert outcomes["answered"] > CALLS


@pytest.mark.parametrize(
    ("offset", "apart"), [(2**63 - 1, 6), (-(2**63), 6), (3, 2**63 - 1), (3, 2**62)]
)
def test_an_offset_beyond_the_parameters(offset: int, apart: int) -> None:
    arguments = descend_arguments(3, 10, torch.float32)
    arguments[7:9] = offset, apart
    with pytest.raises(ValueError, match=r"must lie apart within 24|below 2\^63"):
        torch.ops.granpinn.descend(*arguments)


PLACES = [[-1, 5], [2**40, 20], [60, 11], [0, 0], [0, -(2**63)], [2**63 - 1, 2**63 - 1], [0, 71]]


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_places_beyond_the_points(place: list[int], device: torch.device) -> None:
    """A CPU refuses them. A GPU draws NaN, without waiting: a fault of the same step."""
    arguments = batch_arguments(torch.float32, device)
    arguments[3][1, :2] = torch.tensor(place)
    if device.type == "cpu":
        with pytest.raises(ValueError, match="within the 70 points, got .* for member 1"):
            torch.ops.granpinn.draw_batch(*arguments, 13, 6)
        return
    points, velocity, weights, *rest = torch.ops.granpinn.draw_batch(*arguments, 13, 6)
    for drawn in (points, velocity, weights):
        assert drawn[1].isnan().all()
        assert drawn[[0, 2]].isfinite().all()
    assert all(drawn.isfinite().all() for drawn in rest)


@pytest.mark.parametrize("at", [7, 9, 15, 17])
def test_tensors_that_share_memory(at: int) -> None:
    """The parameters with a moment of them, both moments, and the same of the law."""
    arguments = update_arguments(3, 10, torch.float32)
    same = 8 if at < 14 else 16
    arguments[at] = arguments[same]
    with pytest.raises(ValueError, match="must not share memory with .*: pass a clone"):
        torch.ops.granpinn.update(*arguments)


NAN, INF = float("nan"), float("inf")


def bounds_of(limits: list[float]) -> torch.Tensor:
    return torch.tensor(limits, dtype=torch.float64).view(3, 2).repeat(3, 1, 1)


@pytest.mark.parametrize(
    ("at", "value"),
    [(12, [NAN, 0.9, 0.99, 0]), (12, [1e-3, 1.0, 0.99, 0]), (19, [1e-3, 0.9, 0.99, -1]),
     (13, INF), (21, bounds_of([-4.0, NAN, -4, 1, 0, 0])), (21, bounds_of([2.0, 1, -4, 1, 0, 0]))],
)  # fmt: skip
def test_settings_that_are_no_numbers(at: int, value: float | list[float] | torch.Tensor) -> None:
    arguments = update_arguments(3, 10, torch.float32)
    arguments[at] = value
    with pytest.raises(ValueError, match="must"):
        torch.ops.granpinn.update(*arguments)
