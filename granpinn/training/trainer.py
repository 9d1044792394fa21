"""The state of a training, and the one step that changes it.

A step is: batch, loss and gradients, test, update, test; for E members at once, on the device.
Everything that the next step depends on is in `tensors` and `plain_state`. A training that is
restored from them continues bit for bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from granpinn.config import Config
from granpinn.kernels.network import initial_parameters
from granpinn.training.checkpoint import TrainingState
from granpinn.training.graphs import Graphs
from granpinn.training.guard import NonFiniteError, require_finite_members
from granpinn.training.history import Row, row_of
from granpinn.training.last_layer import last_layer, mean_length
from granpinn.training.law_variables import LawVariables
from granpinn.training.objective import Evaluation, Member, Objective
from granpinn.training.optimise import BatchOptimizer
from granpinn.training.schedule import ControlTable, Schedule

ROLLBACK = 0.5  # factor on every learning rate of a member after a rollback


class Trainer:
    """The networks, the law variables, the optimiser and the place in the schedule.

    Attributes:
        lr_scale: factor on the learning rates of each member.
        diverged: members that are frozen after a second fault, with the reason.
        solved: the members after the last-layer step, with the weights and the length of the mean
            strain rate that it had, their params [P] and theta [N].
        graphs: CUDA graphs of the steps on a GPU; None on a CPU, and for a law
            without kernels, where each step is called.
    """

    def __init__(self, objective: Objective, schedule: Schedule, config: Config) -> None:
        members, device = objective.members, objective.pool.points.device
        starts = [
            initial_parameters(m.problem.spec, m.seed, config.network.initialization)
            for m in members
        ]
        self.objective = objective
        self.schedule = schedule
        self.config = config
        self.params = torch.stack(starts).to(objective.pool.points)
        self.law_variables = LawVariables(
            [m.law for m in members],
            config.rheology,
            [m.fixed for m in members],
            [m.seed for m in members],
            self.params,
        )
        self.control = ControlTable([m.problem.velocity_factor for m in members], config, device)
        self.optimizer = BatchOptimizer(
            self.params,
            self.law_variables,
            objective.spec.widths,
            config.optimizer,
            self.control,
            objective.precision,
        )
        self.step = 0
        self.lr_scale = [1.0] * len(members)
        self.misfit = [0.0] * len(members)
        self.diverged: dict[int, str] = {}
        self.solved: dict[int, tuple[Member, Tensor, Tensor]] = {}
        self.last: Evaluation | None = None
        captured = device.type == "cuda" and objective.operators.captured
        self.graphs = Graphs(self.one_step, self.changing()) if captured else None
        self.remember()

    @property
    def finished(self) -> bool:
        return self.step >= self.schedule.total or len(self.diverged) == len(self.lr_scale)

    def tensors(self) -> dict[str, Tensor]:
        """Every tensor of the state by name, live; each [E, ...]."""
        return {
            "params": self.params,
            "q": self.law_variables.q,
            "theta": self.law_variables.theta,
        } | self.optimizer.tensors()

    def changing(self) -> list[Tensor]:
        """All tensors that a step changes."""
        c = self.control
        return [*self.tensors().values(), self.optimizer.direction, c.counter, c.fault]

    def plain_state(self) -> TrainingState:
        """The rest of the state, as values for JSON."""
        return TrainingState(
            step=self.step,
            lr_scale=tuple(self.lr_scale),
            misfit=tuple(self.misfit),
            diverged={str(e): reason for e, reason in self.diverged.items()},
            total=self.schedule.total,
            from_step=self.schedule.from_step,
            from_progress=self.schedule.from_progress,
        )

    def set_plain_state(self, state: TrainingState) -> None:
        """The inverse of `plain_state`; the caller copies the tensors into `tensors`."""
        self.step = state.step
        self.lr_scale, self.misfit = list(state.lr_scale), list(state.misfit)
        self.diverged = {int(e): reason for e, reason in state.diverged.items()}
        names = ("total", "from_step", "from_progress")
        self.schedule = replace(self.schedule, **{k: getattr(state, k) for k in names})
        self.control.reload()
        self.remember()

    @torch.no_grad()
    def advance(self) -> None:
        """The next steps: one on a CPU; on a GPU all until the next row of the history.

        NonFiniteError: a member is not finite; the caller must restore an earlier state.
        """
        if self.schedule.ends_prefit(self.step):
            self.optimizer.reset()
            self.misfit = self._misfit()
            self.remember()
        steps, prefit = self._stretch(), self.schedule.in_prefit(self.step)
        at = self.schedule, self.step, self.misfit
        self.control.prepare(*at, steps, self.lr_scale, self.diverged)
        if self.graphs is None:
            self.last = self.one_step(prefit)
        else:
            self.last = self.graphs.run(steps, prefit)
            # while the device is busy
            self.control.rows(self.schedule, self.step + steps, self.misfit)
        found = {e: text for e, text in self.control.faults().items() if e not in self.diverged}
        if len(found) + len(self.diverged) < len(self.lr_scale):  # the others made these steps
            self.step += steps
        if found:
            self.control.reload()
            raise NonFiniteError(next(iter(found.values())), found)

    def _misfit(self) -> list[float]:
        """The misfit of the velocity of every member after the pre-fit."""
        found = self.objective.misfit(self.step, self.params, self.law_variables.theta)
        text = f"the misfit of the velocity became NaN or infinite in step {self.step + 1}"
        bad = {e: text for e, m in enumerate(found) if not math.isfinite(m)}
        if new := {e: text for e in bad if e not in self.diverged}:
            raise NonFiniteError(text, new)
        return [0.0 if e in bad else m for e, m in enumerate(found)]

    def one_step(self, prefit: bool) -> Evaluation:
        """Make the step at the counter of `control`, without a copy from device to host."""
        e = self.objective.evaluate(self.control, self.params, self.law_variables.theta, prefit)
        self.optimizer.step(e.loss, e.grad_params, e.grad_theta, law_moves=not prefit)
        return e

    def _stretch(self) -> int:
        """The number of steps before the host reads a result."""
        if self.graphs is None:
            return 1
        every, in_prefit = self.config.log_every, self.schedule.in_prefit
        left = self.schedule.total - self.step
        steps = min(self.control.stretch, every - self.step % every, left)
        if in_prefit(self.step):
            steps = next((i for i in range(1, steps) if not in_prefit(self.step + i)), steps)
        return steps

    def require_finite(self) -> None:
        """Raise NonFiniteError if a tensor of the state holds a NaN or an infinity.

        A step tests what it uses. This finds the rest, before it is copied or saved.
        """
        require_finite_members(self.tensors(), self.diverged, self.step + 1)

    def remember(self) -> None:
        """Keep a copy of the state in memory, for a rollback."""
        self._good = {name: t.clone() for name, t in self.tensors().items()}
        self._good_state = self.plain_state()

    @property
    def remembered(self) -> int:
        """The step of the copy."""
        return self._good_state.step

    def restore(self) -> None:
        """Restore all members from the copy."""
        self._take_back(range(len(self.lr_scale)))
        self.set_plain_state(self._good_state)

    def roll_back(self, members: Collection[int]) -> None:
        """Restore members from the copy; they continue at half the learning rate.

        If no others are left, the run goes back to the step of the copy. Otherwise the others keep
        their state, and the restored members continue with the present step.
        """
        diverged = self.diverged
        if len(members) + len(diverged) == len(self.lr_scale):
            self.restore()
            self.diverged = diverged
        else:
            self._take_back(members)
        for e in members:
            self.lr_scale[e] *= ROLLBACK
        self.remember()

    def give_up(self, reasons: Mapping[int, str]) -> None:
        """Freeze members for good in the state of their copy."""
        self._take_back(reasons)
        self.diverged = {**self.diverged, **reasons}

    def _take_back(self, members: Iterable[int]) -> None:
        for name, tensor in self.tensors().items():
            for e in members:
                tensor[e].copy_(self._good[name][e])

    def solve_last_layer(self, until: float = math.inf) -> None:
        """End the training of the members that are left (granpinn/training/last_layer.py).

        Args:
            until: time.monotonic() at which it should end; every member makes one step at least.
        """
        if not self.config.optimizer.last_layer or self.objective.spec.form != "mixed":
            return
        left = [e for e in range(len(self.lr_scale)) if e not in self.diverged]
        for k, e in enumerate(left):
            now = time.monotonic()
            until_k = now + (until - now) / (len(left) - k)
            trained, member = self.trained(e), self._at_end(e)
            length = mean_length(member, *trained, self.step)
            member = replace(member, problem=replace(member.problem, mean_length=length))
            self.solved[e] = member, *last_layer(member, *trained, self.step, until_k)

    def ended(self, member: int) -> tuple[Member, Tensor, Tensor, int] | None:
        """A member after its last-layer step, and the number of steps; None without it."""
        return (*self.solved[member], self.step) if member in self.solved else None

    def _at_end(self, e: int) -> Member:
        """A member with the weights of the end of the training, and its data on the device."""
        member = self.objective.members[e]
        velocity, *others = member.problem.term_weights
        weights = [velocity * member.problem.velocity_factor(self.misfit[e]), *others]
        problem = replace(member.problem, term_weights=weights)
        return replace(member, problem=problem, data=self.objective.data(e))

    def solution(self, member: int = 0) -> tuple[Tensor, Tensor]:
        """params [P] and theta [N], after the last-layer step if there was one."""
        return self.solved[member][1:] if member in self.solved else self.trained(member)

    def in_units(self, member: int, theta: Sequence[float]) -> list[float]:
        """theta [N] of the law of a member in the units of its flow file."""
        unit = self.objective.members[member].problem.pressure_unit
        return self.objective.laws[member].to_physical(theta, unit)

    def trained(self, member: int = 0) -> tuple[Tensor, Tensor]:
        """params [P] and theta [N] after the steps."""
        theta = self.law_variables.theta[member, : len(self.objective.laws[member].parameters)]
        return self.params[member], theta

    def rows(self, wall_s: float) -> list[Row]:
        """The history row of every member for the step that was just made, with its law in the
        units of the flow file.
        """
        assert self.last is not None
        step = self.step - 1
        rate = self.schedule.learning_rate(step) * self.config.optimizer.learning_rate
        terms = self.last.terms
        if self.schedule.in_prefit(step):
            terms = torch.cat([terms[:, :1], torch.full_like(terms[:, 1:], math.nan)], 1)
        loss, theta = self.last.loss[:, None], self.law_variables.theta
        values = torch.cat([loss, terms, theta], 1).tolist()  # one wait for the device
        found, first = [], 1 + terms.shape[1]  # place of theta
        for e, (law, scale) in enumerate(zip(self.objective.laws, self.lr_scale, strict=True)):
            own = self.in_units(e, values[e][first : first + len(law.parameters)])
            found.append(row_of(law, [self.step, wall_s, *values[e][:first], *own, rate * scale]))
        return found
