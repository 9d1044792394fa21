"""The source term of a flow on its way from the function to the losses of a training."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from granpinn.arrays import Float64
from granpinn.config import Batch
from granpinn.fit.case import Case, pose
from granpinn.training.objective import Objective
from granpinn.training.operators import COMPILED, IN_TORCH
from tests.data.walled import line
from tests.flows import make_flow
from tests.runs import tiny
from tests.training.test_objective import assert_reference_loss

CPU = torch.device("cpu")
BATCH = Batch(interior=50, surface=7)
TILTED = (1.3, -9.72)  # a camera that is not level, so that the training turns the axes


def force(x: Float64, y: Float64, t: Float64) -> tuple[Float64, Float64]:
    return 3 * x - y + 2, t * y - 5 * x


@pytest.fixture(scope="module")
def case() -> Case:
    walls = line((0.0, 0.0), (2.0, 0.0))
    flow = make_flow(gravity=TILTED, source=force, walls=walls)
    return pose(flow, tiny(dtype="float64", seed=4))


def test_it_is_evaluated_at_every_point_of_the_equations(case: Case) -> None:
    data = case.member.data
    assert min(map(len, (data.points, data.between, data.strip, data.wall_points))) > 0
    points = torch.cat([data.points, data.between, data.strip]).numpy()
    tilt = np.arctan2(TILTED[0], -TILTED[1])
    back = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    H, g = case.scales.length, float(np.hypot(*TILTED))
    x, y = back @ points[:, :2].T * H
    expected = back.T @ np.stack(force(x, y, points[:, 2] * np.sqrt(H / g))) / g
    assert data.source is not None
    np.testing.assert_allclose(data.source.numpy(), expected.T, rtol=1e-12, atol=1e-13)
    pooled = data.pooled()
    assert pooled.source is not None
    assert len(pooled.source) == len(pooled.points)
    assert torch.equal(pooled.source[: len(points)], data.source)
    assert not pooled.source[len(points) :].any()


@pytest.mark.parametrize("operators", [COMPILED, IN_TORCH], ids=["compiled", "in torch"])
def test_a_batch_is_the_reference_loss_with_its_source(case: Case, operators: object) -> None:
    """Beside a member without a source, which has the loss that it has alone."""
    without = replace(case.member.data, source=None)
    other = replace(case.member, data=without)
    objective = Objective([case.member, other], BATCH, CPU)
    objective.operators = operators  # type: ignore[assignment]
    alone = Objective([other], BATCH, CPU)
    assert objective.pool.source is not None
    assert alone.pool.source is None
    assert objective.pool.source is not None
    params = torch.randn(2, case.member.problem.spec.n_params, dtype=torch.float64) / 3
    theta = torch.tensor([[0.4, 0.64, 0.3]], dtype=torch.float64).repeat(2, 1)

    def control(members: int) -> SimpleNamespace:
        table = torch.ones(1, 1 + members, dtype=torch.float64)
        return SimpleNamespace(counter=torch.tensor([9, 9, 0]), table=table)

    found = objective.evaluate(control(2), params, theta, prefit=False)  # type: ignore[arg-type]
    assert_reference_loss(found, objective, params, theta, BATCH)
    lone = alone.evaluate(control(1), params[1:], theta[1:], prefit=False)  # type: ignore[arg-type]
    torch.testing.assert_close(found.loss[1:], lone.loss, rtol=1e-12, atol=0)
    assert float(found.terms[0, 2]) != pytest.approx(float(lone.terms[0, 2]), rel=1e-3)
    batch = objective.data(0).loss_points.at(torch.arange(40), slice(5))
    of_points = objective.terms(0, params[0], theta[0], batch)
    without_it = objective.terms(0, params[0], theta[0], batch._replace(source=None))
    assert torch.equal(of_points[[0, 1, 3, 4]], without_it[[0, 1, 3, 4]])
    assert of_points[2] != without_it[2]
