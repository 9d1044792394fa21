"""The loss of one step: a batch of every member's data through the fused residual loss.

A training run has E >= 1 members: networks of one shape that are trained side by side, each with
its own seed and its own problem. The data of all lie one after another on the device.

The points of a step are a pure function of (seed, step), without a state to save: Philox4x32-10 in
C++ (csrc/math/philox.h), the same bits on every device. They are drawn with replacement; the
streams of interior and surface points are independent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from granpinn.config import Batch
from granpinn.data import Flow
from granpinn.kernels import ops
from granpinn.kernels.step_ops import Draw
from granpinn.physics.laws import FrictionLaw
from granpinn.physics.terms import LossPoints
from granpinn.training.operators import operators_of
from granpinn.training.points import TrainingSet
from granpinn.training.problem import Problem
from granpinn.training.schedule import ControlTable

INTERIOR, SURFACE, MISFIT, LAST_LAYER = 0, 1, 2, 3  # streams; the last layer uses 3, 4 and 5


def draw(seed: int, step: int, stream: int, count: int, points: Tensor) -> Tensor:
    """Indices int64 [count] into points [N, ...], on their device; none if there are no points."""
    if len(points) == 0:
        return points.new_empty(0, dtype=torch.int64)
    return ops.sample_indices(seed, step, stream, count, len(points), points.device)


MISFIT_POINTS = 32768


@dataclass(frozen=True)
class Member:
    """One network to be trained.

    Attributes:
        data: may be shared by members.
        fixed: values of the fixed parameters of the law; by default `LawParameter.start`.
        flow: where the data come from, for the identity of a run (identity.py).
    """

    problem: Problem
    data: TrainingSet
    seed: int
    law: FrictionLaw
    fixed: Mapping[str, float]
    flow: Flow | None = None


@dataclass(frozen=True)
class Evaluation:
    """Loss [E], terms [E, 5] and gradients by params [E, P] and theta [E, N] of one step.

    In the pre-fit the terms after the first one and the gradient by theta are 0.
    """

    loss: Tensor
    terms: Tensor
    grad_params: Tensor
    grad_theta: Tensor


class Objective:
    """The data on their device, and the two losses that a run minimizes in turn.

    Attributes:
        laws: the friction law of each member.
        operators: the operators for these laws.
        distinct: training sets of the members, each once.
        pool: the points of all sets, one after another on the device; the source is 0 for sets
            without one, None if no set has one.
        precision: of the products on a GPU, "fp32" or "fast" (granpinn.kernels.ops.residual_loss).
    """

    def __init__(
        self,
        members: Sequence[Member],
        batch: Batch,
        device: torch.device,
        precision: str = "fp32",
    ) -> None:
        self.members = list(members)
        self.precision = precision
        self.laws = [m.law for m in members]
        names = [law.name for law in self.laws]
        self._law_names = ",".join(names if len(set(names)) > 1 else names[:1])
        self.operators = operators_of(self.laws)
        if len({m.problem.spec.widths for m in members}) > 1:
            raise ValueError("members of one run must have networks of the same widths")
        sets = {id(m.data): m.data for m in members}
        self.distinct = list(sets.values())
        self.set_of = [list(sets).index(id(m.data)) for m in members]
        self.sets = [s.pooled() for s in self.distinct]
        has_surface = all(len(s.surface_points) for s in self.sets)
        self.batch = batch if has_surface else replace(batch, surface=0)
        if any(s.source is not None for s in self.sets):
            self.sets = [
                s if s.source is not None else replace(s, source=torch.zeros_like(s.velocity))
                for s in self.sets
            ]
        self.pool = LossPoints._make(self._moved(name, device) for name in LossPoints._fields)
        self.seeds = torch.tensor([m.seed for m in members], device=device)
        self.places = torch.tensor(self._places(), device=device)
        constant = self.pool.points.new_tensor
        self.term_weights = constant([m.problem.term_weights for m in members])
        self.spec = replace(
            members[0].problem.spec,
            input_shift=constant([m.problem.spec.input_shift for m in members]),
            input_scale=constant([m.problem.spec.input_scale for m in members]),
        )
        self.physics = constant([m.problem.physics for m in members])

    def _moved(self, name: str, device: torch.device) -> Tensor | None:
        """An array of all sets, one after another on the device; each set has its part of it."""
        every = [getattr(s, name) for s in self.sets]
        if every[0] is None:
            return None
        whole = (every[0] if len(every) == 1 else torch.cat(every)).to(device).contiguous()
        parts = whole.split([len(own) for own in every])
        self.sets = [replace(s, **{name: p}) for s, p in zip(self.sets, parts, strict=True)]
        return whole

    def _places(self) -> list[list[int]]:
        """[First point, points, first surface point, surface points] of every member."""
        places, point, surface = [], 0, 0
        for s in self.sets:
            places.append([point, len(s.points), surface, len(s.surface_points)])
            point, surface = point + len(s.points), surface + len(s.surface_points)
        return [places[i] for i in self.set_of]

    def data(self, member: int) -> TrainingSet:
        """All points of a member, pooled and on the device.

        Surface points only if the loss has that term.
        """
        own = self.sets[self.set_of[member]]
        if self.batch.surface > 0:
            return own
        line, pressure = own.surface_points[:0], own.surface_pressure[:0]
        return replace(own, surface_points=line, surface_pressure=pressure)

    def evaluate(
        self, control: ControlTable, params: Tensor, theta: Tensor, prefit: bool
    ) -> Evaluation:
        """The loss of the step at the counter of `control`, and its gradients.

        Args:
            params: [E, P].
            theta: parameters of the friction laws [E, N], N those of the longest law.
            prefit: the loss of the velocity alone, without equations and surface; it needs no
                derivatives of the network.
        """
        losses = self.operators.batch_loss(
            params,
            theta,
            Draw(
                control.counter,
                control.table,
                self.seeds,
                self.places,
                self.pool,
                self.term_weights,
                self.batch.interior,
                0 if prefit else self.batch.surface,
            ),
            self.spec,
            self.physics,
            self._law_names,
            precision=self.precision,
            equations=not prefit,
        )
        return Evaluation(*losses)

    def misfit(self, step: int, params: Tensor, theta: Tensor) -> list[float]:
        """The rms misfit of one velocity component over many points, of every member."""
        squares = []
        for e, member in enumerate(self.members):
            data = self.data(e).loss_points
            count = min(MISFIT_POINTS, len(data.points))
            i = draw(member.seed, step, MISFIT, count, data.points)
            batch = data.at(i, slice(0))
            squares.append(self.terms(e, params[e], theta[e], batch, equations=False)[0])
        return [math.sqrt(square) for square in torch.stack(squares).tolist()]

    def terms(
        self,
        member: int,
        params: Tensor,
        theta: Tensor,
        batch: LossPoints,
        equations: bool = True,
    ) -> Tensor:
        """The terms of the loss of one member over some of its points.

        Args:
            params, theta: of this member, [P] and [N].
            equations: without them, the velocity and the surface only.
        """
        law = self.laws[member]
        found: tuple[Tensor, ...] = self.operators.residual_loss(
            params,
            theta[: len(law.parameters)],
            batch,
            self.term_weights[member],
            self.members[member].problem.spec,
            self.physics[member],
            law.name,
            equations=equations,
        )
        return found[1]
