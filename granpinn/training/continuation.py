"""Finished networks that train on with other data: what a change of the data does to the law.

The last layer alone is too stiff for this: its hidden layers have learned where the old data put
the pressure zero. So copies of a network train on with all layers, at the learning rates of the
second half of the schedule (bench/studies/assumptions/note.md). Copies with the same seed draw the
same points, and the scatter of their training cancels in a difference.
"""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from granpinn.training.guard import NonFiniteError
from granpinn.training.objective import Member, Objective
from granpinn.training.room import require_room
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer

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
