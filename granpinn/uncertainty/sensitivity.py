r"""What an uncertain assumption does to the parameters of the law.

An assumption is a number a that the data do not contain, such as the offset of the surface line. It
has a prior with the standard deviation $\sigma_a$. Two copies of the trained network go on training
with a one standard deviation lower and higher. Then

$$ \frac{d\theta}{da} = \frac{\theta(a + \sigma_a) - \theta(a - \sigma_a)}{2 \sigma_a}, \qquad
   C \leftarrow C + \sigma_a^2 \frac{d\theta}{da} \frac{d\theta}{da}^T . $$

The step is the standard deviation itself, because the effect is not linear: a line inside the
grains forces the pressure to zero where there is none outside.

The last layer alone is too stiff for this: its hidden layers have learned where the old data put
the pressure zero. So copies of a network train on with all layers, at the learning rates of the
second half of the schedule (bench/studies/assumptions/note.md). Copies with the same seed draw the
same points, and the scatter of their training cancels in a difference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from granpinn.arrays import Float64
from granpinn.physics.laws import FrictionLaw
from granpinn.results.records import Assumed
from granpinn.training.guard import NonFiniteError
from granpinn.training.objective import Member, Objective
from granpinn.training.room import require_room
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer

DIVERGED = "a training with the assumption changed diverged"


@dataclass(frozen=True)
class Assumption:
    """An assumption of an identification.

    Attributes:
        record: of the assumption, whose effect is not known yet; its `sd` is positive.
        pair: makes the members with the value one `sd` lower and higher; they have the seed of the
            trained member and corresponding points (granpinn/training/points.py).
        change: of the value, in the example of the record.
    """

    record: Assumed
    pair: Callable[[], tuple[Member, Member]]
    change: float

    def without_effect(self, why: str) -> Assumed:
        """The record where the effect is not known, for a reason."""
        return replace(self.record, why=why)


def effects(
    trainer: Trainer,
    assumptions: Mapping[int, Sequence[Assumption]],
    share: float | None = None,
) -> dict[int, tuple[Assumed, ...]]:
    """The effect of every assumption on the law, by members of a finished training.

    All copies are one batch.

    Args:
        share: of the time of the finished training that this one may take; None: any.
    """
    asked = [(e, assumption) for e, every in assumptions.items() for assumption in every]
    if not asked:
        return {}
    copies = [(e, changed) for e, assumption in asked for changed in assumption.pair()]
    most = MOST_STEPS
    if share is not None:  # a copy takes at most the time of a member
        most = min(most, int(share * trainer.step * len(trainer.params) / len(copies)))
    theta = continued(trainer, copies, most)
    found: dict[int, tuple[Assumed, ...]] = {}
    for k, (e, assumption) in enumerate(asked):
        pair = [
            None if t is None else np.array(trainer.in_units(e, t.tolist()))
            for t in theta[2 * k : 2 * k + 2]
        ]
        value = np.array(trainer.in_units(e, trainer.solution(e)[1].tolist()))
        law = trainer.objective.laws[e]
        found[e] = (*found.get(e, ()), _assumed(assumption, law, value, pair[0], pair[1]))
    return found


def _assumed(
    assumption: Assumption,
    law: FrictionLaw,
    value: Float64,
    lower: Float64 | None,
    upper: Float64 | None,
) -> Assumed:
    if lower is None or upper is None:
        return assumption.without_effect(DIVERGED)
    slope = (upper - lower) / (2 * assumption.record.sd)
    places = {name: law.names.index(name) for name in law.free}
    change = assumption.change
    return replace(
        assumption.record,
        derivative={name: float(slope[k]) for name, k in places.items()},
        percent={n: float(100 * slope[k] * change / value[k]) for n, k in places.items()},
    )


BEGIN = 0.5  # place in the schedule whose learning rates the copies begin with
PART, MOST_STEPS = 0.2, 2000  # of the steps of the training, and at most so many


def continued(
    trainer: Trainer, copies: Sequence[tuple[int, Member]], most: int = MOST_STEPS
) -> list[Tensor | None]:
    """theta [N] of copies of finished members after more training; None if a copy diverged.

    Args:
        trainer: of the finished training; it stays as it is.
        copies: number of a member of it, and the problem and data with which its copy goes on.
        most: steps.
    """
    config, device = trainer.config, trainer.params.device
    members = [member for _, member in copies]
    require_room(members, config, device)
    objective = Objective(members, config.batch, device, precision=config.precision)
    begin = max(BEGIN, config.optimizer.prefit)
    steps = max(1, min(most, round(PART * trainer.step)))
    schedule = Schedule(steps, config.optimizer, from_progress=begin)
    copy = Trainer(objective, schedule, config)
    for name, tensor in copy.tensors().items():
        for i, (e, _) in enumerate(copies):
            state = trainer.tensors()[name][e]
            tensor[i].copy_(state[: len(tensor[i])])  # N of the laws of the copies may be less
    copy.misfit = [trainer.misfit[e] for e, _ in copies]
    copy.remember()
    while not copy.finished:
        try:
            copy.advance()
        except NonFiniteError as error:
            copy.give_up(error.members)
    copy.solve_last_layer()
    return [None if i in copy.diverged else copy.solution(i)[1] for i in range(len(copies))]
