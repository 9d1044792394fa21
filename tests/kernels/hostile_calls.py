"""Calls of every operator with some arguments replaced by hostile ones: python -m ... SEED CALLS.

Run in a process of its own. It names the call that it makes on standard error, so that a crash can
be repeated, and prints how many calls were answered, refused, and refused by torch.
"""

from __future__ import annotations

import json
import random
import resource
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from granpinn.kernels import ops  # noqa: F401  (registers the operators)

from .op_inputs import INPUTS

# Space for 2 GiB of tensors: a size of 2^40 is refused by the allocator, not by the machine.
ADDRESS_SPACE = 2 << 30
# The checks raise ValueError and TypeError; torch's dispatcher and allocator raise the others.
REFUSALS = (ValueError, TypeError, RuntimeError, LookupError, OverflowError)

INTEGERS = [-(2**63), -(2**62), -1, 0, 1, 3, 64, 2**31, 2**32, 2**62, 2**63 - 1]
NUMBERS = [float("nan"), float("inf"), -float("inf"), 0.0, -1.0, 1e308, 5e-324]
TEXTS = ["", "mixed", "strong", "data", "coulomb", "mu_of_i", "fast", "x" * 70_000, "é\0"]
NO_GAPS_DTYPES = [torch.float16, torch.int32, torch.bool, torch.complex64, torch.uint8]


def filled(x: Tensor, rng: random.Random) -> Tensor:
    values: list[Any] = NUMBERS if x.is_floating_point() else INTEGERS
    out = x.detach().clone()
    for i in range(out.numel()) if rng.random() < 0.5 else rng.choices(range(max(1, out.numel()))):
        if out.numel():
            out.view(-1)[i] = rng.choice(values)
    return out


CHANGES: list[Callable[[Tensor, random.Random], Tensor]] = [
    filled,
    filled,
    filled,
    lambda x, rng: x.to(rng.choice(NO_GAPS_DTYPES)),
    lambda x, rng: x.double() if x.dtype == torch.float32 else x.float(),
    lambda x, rng: x[:0] if x.dim() else x.new_empty(0),
    lambda x, rng: x.flatten()[:1].squeeze(),
    lambda x, rng: x.unsqueeze(0),
    lambda x, rng: x.mT if x.dim() > 1 else x.flip(0),
    lambda x, rng: x[1:] if x.dim() else x,
    lambda x, rng: x.narrow(-1, 0, x.shape[-1] // 2) if x.dim() else x,
    lambda x, rng: x.flatten()[:1].expand(x.shape) if x.numel() else x,
    lambda x, rng: x.new_zeros(1).expand(2 ** rng.choice([10, 40, 62]), *x.shape[1:-1], 1),
    lambda x, rng: x.new_zeros(1).expand(*x.shape[:-1], 2 ** rng.choice([10, 40, 62])),
    lambda x, rng: torch.cat([x, x]) if x.dim() else x,
    lambda x, rng: torch._neg_view(x),
    lambda x, rng: torch._efficientzerotensor(x.shape, dtype=x.dtype),
    lambda x, rng: x.to_sparse() if x.dim() else x,
    lambda x, rng: x.to("meta"),
    lambda x, rng: x.detach().clone().requires_grad_() if x.is_floating_point() else x,
]


def hostile(arguments: list[Any], rng: random.Random) -> Any:
    """Something of the same kind as one of the arguments; a tensor may also be another one."""
    old = rng.choice(arguments)
    if isinstance(old, Tensor):
        tensors = [x for x in arguments if isinstance(x, Tensor)]
        return old, (
            rng.choice(tensors)
            if rng.random() < 0.15 or old.numel() > 10_000
            else rng.choice(CHANGES)(old, rng)
        )
    if isinstance(old, bool):
        return old, not old
    if isinstance(old, int):
        return old, rng.choice(INTEGERS)
    if isinstance(old, float):
        return old, rng.choice(NUMBERS)
    if isinstance(old, str):
        return old, rng.choice(TEXTS)
    pool: list[Any] = NUMBERS if any(isinstance(x, float) for x in old) else INTEGERS
    new = [rng.choice([x, x, rng.choice(pool)]) for x in old]
    return old, rng.choice([new, new, new, new[:-1], new * 2, [], new[:4] * 10_000])


def call(operator: str, rng: random.Random) -> str:
    """Makes one call; the class of what it raised, or "answered"."""
    arguments = list(INPUTS[operator][rng.choice(list(INPUTS[operator]))]())
    try:
        for _ in range(rng.choice([1, 1, 1, 2, 3])):
            old, new = hostile(arguments, rng)
            at = next(i for i, x in enumerate(arguments) if x is old)
            arguments[at] = new
        getattr(torch.ops.granpinn, operator)(*arguments)
    except REFUSALS as error:
        return type(error).__name__
    return "answered"


def main(seed: int, calls: int) -> None:
    if "libasan" not in Path("/proc/self/maps").read_text():  # it reserves the address space itself
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESS_SPACE,) * 2)
    torch.set_num_threads(1)
    outcomes: Counter[str] = Counter()
    for number in range(calls):
        for operator in INPUTS:
            print(operator, number, file=sys.stderr, flush=True)
            outcomes[call(operator, random.Random(f"{seed} {operator} {number}"))] += 1
    print(json.dumps(outcomes))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
