"""The loss at the end of a training, against automatic differentiation."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import torch

from granpinn import reference
from granpinn.data import Flow
from granpinn.fit.case import pose
from granpinn.fit.ensemble import final_terms
from granpinn.identification.start import start
from granpinn.kernels.builds import choose_device
from tests.data.walled import FLOOR
from tests.runs import tiny


def test_final_loss_is_that_of_all_points_below_the_highest_vectors(flow: Flow) -> None:
    config = tiny(dtype="float64")
    cases = [pose(replace(flow, walls=FLOOR), config)]
    run = start(cases, config, None, None, time.monotonic(), choose_device("cpu"))
    run.train()
    found = final_terms(run.trainer, 0)
    objective = run.trainer.objective
    params, theta = run.trainer.trained(0)
    problem, data = objective.members[0].problem, objective.members[0].data
    places = torch.arange(len(objective.pool.points))  # vectors, points between, strip, walls
    first, walls = len(data.points) + len(data.between), len(places) - len(data.wall_points)
    assert first < walls < len(places)
    held = objective.pool.at(places[(places < first) | (places >= walls)], slice(None))
    terms = reference.loss_terms(params, theta, held, problem.spec, problem.physics)
    velocity, equations = held.point_weights.mean(0)  # a part of all points
    terms = terms / torch.stack([velocity, torch.ones(()), *[equations] * 3])
    np.testing.assert_allclose(found, terms.tolist(), rtol=1e-9)
