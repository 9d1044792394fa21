"""Numbers that are not finite.

Loss and gradients are tested before the update that uses them, the parameters after it. So a NaN is
found in the step that makes it (csrc/step.h; `ControlTable.faults` reads the result). The first
time, the training loop goes back to its last good state, at half the learning rate: this helps if
the steps were too long. The second time the run stops and names the tensor. If the run has several
members, only the faulty ones stop.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

import torch
from torch import Tensor
from torch.nn.utils import get_total_norm

from granpinn.errors import CannotGoOn


class NonFiniteError(CannotGoOn):
    """A tensor of the training state holds a NaN or an infinity; the message names it.

    Attributes:
        members: the faulty members of the run, each with its own sentence.
    """

    def __init__(self, message: str, members: Mapping[int, str] | None = None) -> None:
        super().__init__(message)
        self.members = dict(members or {})


def require_finite_members(
    tensors: Mapping[str, Tensor], frozen: Container[int], step: int
) -> None:
    """Raise NonFiniteError for members whose state [E, ...] holds a NaN or an infinity.

    Args:
        frozen: members that do not count.
        step: the one before which it was found.
    """
    numbers = [t for t in tensors.values() if t.is_floating_point()]
    if get_total_norm(numbers, math.inf).isfinite():
        return
    sound = torch.stack([t.isfinite().flatten(1).all(1) for t in tensors.values()])
    bad = {
        e: f"the tensor {name} became NaN or infinite before step {step}"
        for name, row in zip(tensors, sound.tolist(), strict=True)
        for e, good in enumerate(row)
        if not good and e not in frozen
    }
    if bad:
        raise NonFiniteError(next(iter(bad.values())), bad)
