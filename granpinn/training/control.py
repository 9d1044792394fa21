"""What a step must know of the host: where the run is, its schedule, and which members are sound.

The schedule is a pure function of the step in Python. The rows of the next steps are computed
ahead, copied to the device once, and found there by the step counter, which lives on the device
too: no number crosses to or from the host in a step, and a captured CUDA graph freezes none.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt
import torch

ROWS = 256
HEALTHY = torch.iinfo(torch.int64).max
FAULTS = (
    "loss",
    "gradient of the network parameters",
    "gradient of the rheology",
    "network parameters",
    "rheology scalars",
)
_CODES = 8  # csrc/step.h: fault = step * 8 + index into FAULTS


class Control:
    """Tensors on the device that steer the steps of E members.

    Attributes:
        table: [ROWS, 2 + E] float64: factor on the learning rates, weight of the parameters in
            their running average, factor on the weight of each member's velocity term.
        counter: int64 [3]: step, step of the table's first row, and 0 (the update's own).
        slower: float64 [E], a factor on the learning rates of a member.
        fault: int64 [E], the first thing of a member that was not finite; HEALTHY if none.
    """

    def __init__(self, members: int, device: torch.device) -> None:
        self.table = torch.zeros(ROWS, 2 + members, dtype=torch.float64, device=device)
        self.counter = torch.zeros(3, dtype=torch.int64, device=device)
        self.slower = torch.ones(members, dtype=torch.float64, device=device)
        self.fault = torch.full((members,), HEALTHY, dtype=torch.int64, device=device)

    def load(
        self,
        step: int,
        rows: npt.NDArray[np.float64],
        slower: Sequence[float],
        lost: Collection[int],
    ) -> None:
        """Set the next step and the rows [n, 2 + E] from it on; members in `lost` stay frozen."""
        self.table[: len(rows)].copy_(torch.from_numpy(rows))
        self.counter.copy_(torch.tensor([step, step, 0]))
        self.slower.copy_(torch.tensor(slower, dtype=torch.float64))
        frozen = torch.full((len(slower),), HEALTHY)
        frozen[list(lost)] = 0
        self.fault.copy_(frozen)

    def faults(self) -> dict[int, str]:
        """Member: "the loss became NaN or infinite in step 24", for those that have a fault."""
        codes = self.fault.tolist()
        return {e: _sentence(code) for e, code in enumerate(codes) if code != HEALTHY}


def _sentence(fault: int) -> str:
    step, what = divmod(fault, _CODES)
    return f"the {FAULTS[what]} became NaN or infinite in step {step + 1}"
