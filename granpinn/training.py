"""The state of a training run, and the one step that changes it.

A step is: batch, loss and gradients, test, update, test. Everything that the next step depends on
is in `tensors` and `plain_state`; a run that is restored from them continues bit for bit.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import torch
from torch import Tensor

from granpinn.config import Config
from granpinn.guard import NonFiniteError, first_nonfinite
from granpinn.history import Row
from granpinn.network import initial_parameters
from granpinn.objective import Evaluation, Objective
from granpinn.optimise import FlatOptimizer, average_into
from granpinn.problem import velocity_relaxation
from granpinn.scalars import Scalars
from granpinn.schedule import Schedule

SLOWER = 0.5  # factor on every learning rate after a rollback


class Training:
    """The network, the rheology scalars, the optimizer and the place in the schedule."""

    def __init__(self, objective: Objective, schedule: Schedule, config: Config) -> None:
        spec = objective.problem.spec
        self.objective = objective
        self.schedule = schedule
        self.params = initial_parameters(spec, config.seed, config.network.initialization).to(
            objective.points
        )
        self.scalars = Scalars(config.rheology, config.I0, config.seed, self.params)
        self.optimizer = FlatOptimizer(
            self.params, self.scalars.values, spec.widths, config.optimizer
        )
        self.average_params = self.params.clone()
        self.average_scalars = self.scalars.values.clone()
        self.averaged = 0
        self.weights = config.weights
        self.misfit = 0.0
        self.step = 0
        self.slower = 1.0
        self.last: Evaluation | None = None
        self._good = self._copy()

    @property
    def finished(self) -> bool:
        return self.step >= self.schedule.total

    def tensors(self) -> dict[str, Tensor]:
        """Every tensor of the state by name, live."""
        return {
            "params": self.params,
            "scalars": self.scalars.values,
            "average.params": self.average_params,
            "average.scalars": self.average_scalars,
        } | self.optimizer.tensors()

    def plain_state(self) -> dict[str, Any]:
        """The rest of the state, as JSON values."""
        return {
            "step": self.step,
            "averaged": self.averaged,
            "slower": self.slower,
            "misfit": self.misfit,
            "total": self.schedule.total,
            "from_step": self.schedule.from_step,
            "from_progress": self.schedule.from_progress,
        }

    def set_plain_state(self, state: dict[str, Any]) -> None:
        """The inverse of `plain_state`; the tensors are copied into `tensors` by the caller."""
        self.step, self.averaged = state["step"], state["averaged"]
        self.slower, self.misfit = state["slower"], state["misfit"]
        names = ("total", "from_step", "from_progress")
        self.schedule = dataclasses.replace(self.schedule, **{k: state[k] for k in names})
        self._good = self._copy()

    @torch.no_grad()
    def advance(self) -> None:
        """One step. NonFiniteError: a tensor is not finite, the state is not to be kept."""
        if self.schedule.changes(self.step):
            self.optimizer.reset()
            self.misfit = self.objective.misfit(self.step, self.params, self.scalars.theta())
        e = self._evaluate()
        self._require_finite(_gradients(e))
        grad_scalars = None if e.grad_theta is None else self.scalars.pull_back(e.grad_theta)
        self.optimizer.step(e.grad_params, grad_scalars, self.learning_rate())
        self._require_finite(
            {"network parameters": self.params, "rheology scalars": self.scalars.values}
        )
        self.scalars.confine()
        if self.schedule.averages(self.step):
            self.averaged += 1
            average_into(self.average_params, self.params, self.averaged)
            average_into(self.average_scalars, self.scalars.values, self.averaged)
        self.last = e
        self.step += 1

    def _evaluate(self) -> Evaluation:
        step, o, theta = self.step, self.objective, self.scalars.theta()
        if self.schedule.velocity_alone(step):
            return o.velocity_alone(step, self.params, theta)
        done, _ = self.schedule.stage(step)
        weight = o.problem.term_weights[0]
        relaxation = velocity_relaxation(self.weights, weight, self.misfit, done)
        return o.everything(step, self.params, theta, relaxation)

    def _require_finite(self, tensors: dict[str, Tensor]) -> None:
        if name := first_nonfinite(tensors):
            raise NonFiniteError(f"the {name} became NaN or infinite in step {self.step + 1}")

    def learning_rate(self) -> float:
        """Factor on every learning rate of the settings in the next step."""
        return self.slower * self.schedule.learning_rate(self.step)

    def remember(self) -> None:
        """Keep a copy of the state in memory to go back to."""
        self._good = self._copy()

    def restore(self) -> None:
        """Go back to the last copy."""
        tensors, state = self._good
        for name, tensor in self.tensors().items():
            tensor.copy_(tensors[name])
        self.set_plain_state(state)

    def roll_back(self) -> None:
        """Go back to the last copy and on at half the learning rate."""
        self.restore()
        self.slower *= SLOWER
        self.remember()

    def _copy(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        return {name: t.clone() for name, t in self.tensors().items()}, self.plain_state()

    def solution(self) -> tuple[Tensor, Tensor]:
        """params [P] and theta [3]: the average where the schedule has reached it."""
        if self.averaged:
            return self.average_params, self.scalars.theta(self.average_scalars)
        return self.params, self.scalars.theta()

    def row(self, wall_s: float) -> Row:
        """The history row of the step that was just made."""
        assert self.last is not None
        rate = self.slower * self.schedule.learning_rate(self.step - 1)
        rate *= self.optimizer.settings.learning_rate
        values = torch.cat([self.last.loss.reshape(1), self.last.terms, self.scalars.theta()])
        return Row(*(self.step, wall_s, *values.tolist(), rate))


def _gradients(e: Evaluation) -> dict[str, Tensor]:
    found = {"loss": e.loss, "gradient of the network parameters": e.grad_params}
    return found if e.grad_theta is None else found | {"gradient of the rheology": e.grad_theta}
