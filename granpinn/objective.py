"""The loss of one step: a batch of the training set through the fused residual loss."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from granpinn import ops
from granpinn.config import Batch
from granpinn.data import TrainingSet
from granpinn.op_rules import TERMS
from granpinn.problem import Problem
from granpinn.sampling import INTERIOR, MISFIT, SURFACE, draw

MISFIT_POINTS = 32768


@dataclass(frozen=True)
class Evaluation:
    """Loss [], terms [5] (NaN: not part of this step) and gradients [P], [3] of one step.

    grad_theta is None where the loss does not depend on the rheology.
    """

    loss: Tensor
    terms: Tensor
    grad_params: Tensor
    grad_theta: Tensor | None


class Objective:
    """The training set on its device, and the two losses that a run minimizes in turn."""

    def __init__(
        self, problem: Problem, data: TrainingSet, batch: Batch, seed: int, device: torch.device
    ) -> None:
        self.problem = problem
        self.batch = batch
        self.seed = seed
        self.points = data.points.to(device)
        self.velocity = data.velocity.to(device)
        self.point_weights = data.point_weights.to(device)
        self.surface_points = data.surface_points.to(device)
        self.surface_pressure = data.surface_pressure.to(device)
        self.term_weights = self.points.new_tensor(problem.term_weights)
        self.absent = self.points.new_full((len(TERMS) - 1,), math.nan)

    def tensors(self) -> dict[str, Tensor]:
        """The data by name, for the check that they are finite."""
        return {
            "points": self.points,
            "velocities": self.velocity,
            "weights": self.point_weights,
            "surface points": self.surface_points,
            "surface pressures": self.surface_pressure,
        }

    def everything(
        self, step: int, params: Tensor, theta: Tensor, relaxation: float = 1.0
    ) -> Evaluation:
        """All terms and their gradients at params [P], theta [3].

        Args:
            relaxation: factor on the weight of the velocity term.
        """
        i = draw(self.seed, step, INTERIOR, self.batch.interior, self.points)
        j = draw(self.seed, step, SURFACE, self.batch.surface, self.surface_points)
        weights = self.term_weights
        if relaxation != 1:
            weights = weights * weights.new_tensor([relaxation, 1, 1, 1, 1])
        form = self.problem.spec.form
        return Evaluation(*self._loss(i, j, params, theta, weights, form))

    def velocity_alone(self, step: int, params: Tensor, theta: Tensor) -> Evaluation:
        """The velocity term and its gradient: no derivative of the network is needed."""
        i = draw(self.seed, step, INTERIOR, self.batch.interior, self.points)
        loss, terms, grad_params, _ = self._loss(i, i[:0], params, theta, self.term_weights, "data")
        return Evaluation(loss, torch.cat([terms[:1], self.absent]), grad_params, None)

    def misfit(self, step: int, params: Tensor, theta: Tensor) -> float:
        """Root mean square of what one velocity component is off, over many points."""
        count = min(MISFIT_POINTS, len(self.points))
        i = draw(self.seed, step, MISFIT, count, self.points)
        _, terms, _, _ = self._loss(i, i[:0], params, theta, self.term_weights, "data")
        return math.sqrt(float(terms[0]))

    def _loss(
        self, i: Tensor, j: Tensor, params: Tensor, theta: Tensor, weights: Tensor, form: str
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        spec = self.problem.spec
        return ops.residual_loss(
            params,
            theta,
            self.points[i],
            self.velocity[i],
            self.point_weights[i],
            self.surface_points[j],
            self.surface_pressure[j],
            weights,
            spec.widths,
            spec.input_shift,
            spec.input_scale,
            self.problem.physics,
            form,
        )
