"""The state of a training run, and the one step that changes it.

A step is: batch, loss and gradients, test, update, test; for E members at once, on the device.
Everything that the next step depends on is in `tensors` and `plain_state`; a run that is restored
from them continues bit for bit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from granpinn.config import Config
from granpinn.kernels.network import initial_parameters
from granpinn.training.control import Control
from granpinn.training.engine import engine
from granpinn.training.guard import NonFiniteError
from granpinn.training.history import Row
from granpinn.training.last_layer import last_layer
from granpinn.training.objective import Evaluation, Objective
from granpinn.training.optimise import BatchOptimizer
from granpinn.training.parallel import Alone, Processes
from granpinn.training.plan import Place, Plan
from granpinn.training.problem import velocity_relaxation
from granpinn.training.scalars import Scalars
from granpinn.training.schedule import Schedule

SLOWER = 0.5  # factor on every learning rate of a member after a rollback


class Training:
    """The networks, the rheology scalars, the optimizer and the place in the schedule.

    Attributes:
        slower: factor on the learning rates of each member.
        lost: members that were given up, with the reason; they stay as they are.
        solved: params [P] and theta [3] of the members whose last layer has been solved for.
    """

    def __init__(
        self,
        objective: Objective,
        schedule: Schedule,
        config: Config,
        processes: Processes | None = None,
    ) -> None:
        members, device = objective.members, objective.points.device
        starts = [
            initial_parameters(m.problem.spec, m.seed, config.network.initialization)
            for m in members
        ]
        self.objective = objective
        self.schedule = schedule
        self.config = config
        self.processes = processes or Alone()
        self.params = torch.stack(starts).to(objective.points)
        self.scalars = Scalars(
            config.rheology, [m.I0 for m in members], [m.seed for m in members], self.params
        )
        self.control = Control(len(members), device)
        self.optimizer = BatchOptimizer(
            self.params,
            self.scalars,
            objective.spec.widths,
            config.optimizer,
            self.control,
            objective.precision,
        )
        self.step = 0
        self.averaged = 0
        self.slower = [1.0] * len(members)
        self.misfit = [0.0] * len(members)
        self.lost: dict[int, str] = {}
        self.solved: dict[int, tuple[Tensor, Tensor]] = {}
        self.last: Evaluation | None = None
        self.engine = engine(self.one_step, self._changing(), device)
        weights = [m.problem.term_weights[0] for m in members]
        self.plan = Plan(self.control, config, weights)
        self._good = self._copy()

    @property
    def finished(self) -> bool:
        return self.step >= self.schedule.total or len(self.lost) == len(self.slower)

    def tensors(self) -> dict[str, Tensor]:
        """Every tensor of the state by name, live; each [E, ...]."""
        return {
            "params": self.params,
            "scalars": self.scalars.values,
            "theta": self.scalars.theta,
        } | self.optimizer.tensors()

    def plain_state(self) -> dict[str, Any]:
        """The rest of the state, as JSON values."""
        return {
            "step": self.step,
            "averaged": self.averaged,
            "slower": list(self.slower),
            "misfit": list(self.misfit),
            "lost": {str(e): reason for e, reason in self.lost.items()},
            "total": self.schedule.total,
            "from_step": self.schedule.from_step,
            "from_progress": self.schedule.from_progress,
        }

    def set_plain_state(self, state: dict[str, Any]) -> None:
        """The inverse of `plain_state`; the tensors are copied into `tensors` by the caller."""
        self.step, self.averaged = state["step"], state["averaged"]
        self.slower, self.misfit = list(state["slower"]), list(state["misfit"])
        self.lost = {int(e): reason for e, reason in state["lost"].items()}
        names = ("total", "from_step", "from_progress")
        self.schedule = dataclasses.replace(self.schedule, **{k: state[k] for k in names})
        self.plan.step = None
        self._good = self._copy()

    @torch.no_grad()
    def advance(self) -> None:
        """The next steps: one on a CPU, on a GPU all to the next row of the history.

        NonFiniteError: a member is not finite; the state is not to be kept.
        """
        if self.schedule.changes(self.step):
            self.optimizer.reset()
            misfit = self.objective.misfit(self.step, self.params, self.scalars.theta)
            self.misfit = self.processes.first(misfit)
            self.plan.step = None
            self.remember()
        steps = self._stretch()
        place = self._place()
        rows = self.plan.ready(place, steps, self.slower, self.lost)
        self.last = self.engine.run(steps, self.schedule.velocity_alone(self.step))
        after = dataclasses.replace(
            place,
            step=self.step + steps,
            averaged=self.averaged + int(np.count_nonzero(rows[:, 1])),
        )
        if self.engine.many:  # the device is busy now
            self.plan.rows(after)
        found = {e: text for e, text in self.control.faults().items() if e not in self.lost}
        if len(found) + len(self.lost) < len(self.slower):  # the others have made these steps
            self.step, self.averaged = after.step, after.averaged
        if found:
            self.plan.step = None
            raise NonFiniteError(next(iter(found.values())), found)

    def one_step(self, velocity_alone: bool) -> Evaluation:
        """The step that the control is at, on the device: nothing in here looks at a number."""
        e = self.objective.evaluate(self.control, self.params, self.scalars.theta, velocity_alone)
        e = self.processes.mean(e)
        self.optimizer.step(e.loss, e.grad_params, e.grad_theta, law_moves=not velocity_alone)
        return e

    def _changing(self) -> list[Tensor]:
        """All tensors that a step changes."""
        c = self.control
        return [*self.tensors().values(), self.optimizer.direction, c.counter, c.fault]

    def _stretch(self) -> int:
        """How many steps nobody on the host needs to look at."""
        if not self.engine.many:
            return 1
        every = self.config.log_every
        left = self.schedule.total - self.step
        steps = min(self.plan.stretch, every - self.step % every, left)
        alone = self.schedule.velocity_alone
        if alone(self.step):
            steps = next((i for i in range(1, steps) if not alone(self.step + i)), steps)
        return steps

    def _place(self) -> Place:
        return Place(self.schedule, self.step, self.averaged, tuple(self.misfit))

    def remember(self) -> None:
        """Keep a copy of the state in memory to go back to."""
        self._good = self._copy()

    @property
    def copied(self) -> int:
        """The step of that copy."""
        return int(self._good[1]["step"])

    def restore(self) -> None:
        """Go back to the last copy."""
        tensors, state = self._good
        for name, tensor in self.tensors().items():
            tensor.copy_(tensors[name])
        self.set_plain_state(state)

    def roll_back(self, members: Iterable[int]) -> None:
        """Take members back to the last copy, and on at half the learning rate.

        Where no others are left, the run goes back to the step of the copy; else the others lose
        nothing, and those go on from their copy with the present step.
        """
        members, lost = set(members), self.lost
        if len(members) + len(lost) == len(self.slower):
            self.restore()
            self.lost = lost
        else:
            self._take_back(members)
        for e in members:
            self.slower[e] *= SLOWER
        self.plan.step = None
        self.remember()

    def give_up(self, reasons: Mapping[int, str]) -> None:
        """Leave members alone from here on, as they were in the last copy."""
        self._take_back(reasons)
        self.lost = {**self.lost, **reasons}
        self.plan.step = None

    def _take_back(self, members: Iterable[int]) -> None:
        good, _ = self._good
        for name, tensor in self.tensors().items():
            for e in members:
                tensor[e].copy_(good[name][e])

    def _copy(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        return {name: t.clone() for name, t in self.tensors().items()}, self.plain_state()

    def solve_last_layer(self) -> None:
        """End the training of the members that are left (granpinn/training/last_layer.py)."""
        if not self.config.optimizer.last_layer or self.objective.spec.form != "mixed":
            return
        for e, member in enumerate(self.objective.members):
            if e not in self.lost:
                problem = dataclasses.replace(member.problem, term_weights=self.final_weights(e))
                data, start = self.objective.data(e), self.trained(e)
                self.solved[e] = last_layer(problem, data, *start, member.seed, self.step)

    def final_weights(self, member: int) -> list[float]:
        """1/sigma^2 of the terms at the end of the training."""
        weights = list(self.objective.members[member].problem.term_weights)
        settings, misfit = self.config.weights, self.misfit[member]
        weights[0] *= float(velocity_relaxation(settings, weights[0], misfit, 1.0))
        return weights

    def solution(self, member: int = 0) -> tuple[Tensor, Tensor]:
        """params [P] and theta [3], at the end of a run with the last layer solved for."""
        return self.solved.get(member) or self.trained(member)

    def trained(self, member: int = 0) -> tuple[Tensor, Tensor]:
        """The same as the steps have left them: the average where the schedule has reached it."""
        if self.averaged:
            theta = self.scalars.law(self.optimizer.average_q)
            return self.optimizer.average_params[member], theta[member]
        return self.params[member], self.scalars.theta[member]

    def rows(self, wall_s: float) -> list[Row]:
        """The history row of every member for the step that was just made."""
        assert self.last is not None
        step = self.step - 1
        rate = self.schedule.learning_rate(step) * self.config.optimizer.learning_rate
        terms = self.last.terms
        if self.schedule.velocity_alone(step):
            terms = torch.cat([terms[:, :1], torch.full_like(terms[:, 1:], math.nan)], 1)
        values = torch.cat([self.last.loss[:, None], terms, self.scalars.theta], 1)
        return [
            Row(*(self.step, wall_s, *row, rate * slower))
            for row, slower in zip(values.tolist(), self.slower, strict=True)
        ]
