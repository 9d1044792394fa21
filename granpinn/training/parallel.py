"""Several processes for one run, started by torchrun.

Each process draws an equal share of every batch; all shares together are the batch of a single
process. One all-reduce in a step averages losses and gradients. The update then has the same bits
everywhere, so parameters are never sent. The first process makes the decisions that depend on the
clock, and a signal to any process stops all of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor, distributed

from granpinn.config import ConfigError
from granpinn.errors import CannotGoOn
from granpinn.kernels import builds
from granpinn.training.objective import Evaluation

MOST_PROCESSES = 2**16


class Processes:
    """The processes of a run: this one alone, unless it is a `Group`.

    Attributes:
        rank, size: number of this process, and how many there are.
        device: of the training in this process.
    """

    rank, size = 0, 1

    def __init__(self, device: torch.device) -> None:
        self.device = device

    def all_reduce(self, e: Evaluation) -> Evaluation:
        """The mean of the evaluations of all shares: that of the whole batch."""
        return e

    def broadcast(self, values: Sequence[float]) -> list[float]:
        """The values of the first process."""
        return list(values)

    def stopping(self, asked: bool) -> bool:
        """Whether any process was asked to stop; the same in all processes after a step."""
        return asked

    def barrier(self) -> None:
        """Wait for all processes."""


class ProcessGroup(Processes):
    """The processes of torch.distributed's default group."""

    def __init__(self, device: torch.device) -> None:
        super().__init__(device)
        self.rank, self.size = distributed.get_rank(), distributed.get_world_size()
        self.asked = torch.zeros(1, device=device)
        self.any_asked = torch.zeros(1, device=device)

    def all_reduce(self, e: Evaluation) -> Evaluation:
        parts = (e.loss, e.terms, e.grad_params, e.grad_theta)
        flat = torch.cat([*(part.flatten() for part in parts), self.asked.to(e.loss)])
        distributed.all_reduce(flat)
        self.any_asked.copy_(flat[-1:])
        flat /= self.size
        pieces = torch.split(flat[:-1], [part.numel() for part in parts])
        return Evaluation(*(p.view_as(part) for p, part in zip(pieces, parts, strict=True)))

    def broadcast(self, values: Sequence[float]) -> list[float]:
        shared = torch.tensor(values, dtype=torch.float64)
        distributed.broadcast(shared, 0)
        return shared.tolist()

    def stopping(self, asked: bool) -> bool:
        if asked:
            self.asked.fill_(1)
        return bool(self.any_asked.item() > 0)

    def barrier(self) -> None:
        distributed.all_reduce(torch.zeros(1))  # by gloo: distributed.barrier() uses the GPU


def processes(name: str) -> Processes:
    """The group of torchrun after `joined`, or this process alone, with its device by name."""
    device = choose_device(name)
    grouped = distributed.is_available() and distributed.is_initialized()
    many = grouped and distributed.get_world_size() > 1
    return ProcessGroup(device) if many else Processes(device)


def choose_device(name: str) -> torch.device:
    """The device for "auto", "cpu" or "cuda"; ConfigError if it cannot be used."""
    kernels = torch._C._dispatch_has_kernel_for_dispatch_key("granpinn::residual_loss", "CUDA")
    if name == "cuda" and not kernels:
        raise ConfigError(
            f"--device cuda needs the CUDA kernels ({builds.cuda_missing()}): install the wheel "
            "with them, or build granpinn where nvcc is, or use --device cpu"
        )
    if name == "cuda" and not torch.cuda.is_available():
        raise ConfigError(
            "--device cuda needs a GPU that torch can use, and torch.cuda.is_available() is false: "
            "python -m granpinn.doctor says why; or use --device cpu"
        )
    usable = kernels and torch.cuda.is_available()
    return torch.device("cuda" if usable and name != "cpu" else "cpu")


@contextmanager
def joined() -> Iterator[int]:
    """Join the group of torchrun, if any, and leave it at the end; yields the rank.

    NCCL sends tensors of GPUs, gloo the others; each process uses the GPU of its local rank.
    """
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    size = _variable("WORLD_SIZE", 1, MOST_PROCESSES, "1")
    if size < 2:
        yield 0
        return
    _variable("RANK", 0, size - 1)
    _variable("MASTER_PORT", 0, 65535)
    if "MASTER_ADDR" not in os.environ:
        raise _not_started("MASTER_ADDR must be the first host", "nothing")
    if gpus:
        torch.cuda.set_device(_variable("LOCAL_RANK", 0, gpus - 1))
    try:
        distributed.init_process_group("cpu:gloo,cuda:nccl" if gpus else "gloo")
    except (RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0][:160]
        raise CannotGoOn(
            f"the {size} processes cannot join ({reason}): check that torchrun started all of them"
        ) from error
    try:
        yield distributed.get_rank()
    finally:
        distributed.destroy_process_group()


def _variable(name: str, low: int, high: int, default: str = "nothing") -> int:
    """A whole number of the environment of torchrun; ConfigError for anything else."""
    text = os.environ.get(name, default)
    if not (text.isascii() and text.isdigit() and low <= int(text) <= high):
        raise _not_started(f"{name} must be a whole number from {low} to {high}", text)
    return int(text)


def _not_started(wanted: str, found: str) -> ConfigError:
    return ConfigError(
        f"the environment variable {wanted}, got {found}: start the processes with torchrun, or "
        "unset WORLD_SIZE"
    )


def gather_texts(text: str) -> list[str]:
    """One text of every process, in the order of their ranks.

    As bytes: torch would pickle objects.
    """
    if not distributed.is_initialized():
        return [text]
    content = text.encode()
    size = distributed.get_world_size()
    lengths = [torch.zeros(1, dtype=torch.int64) for _ in range(size)]
    distributed.all_gather(lengths, torch.tensor([len(content)]))
    longest = max(int(n) for n in lengths)
    own = torch.zeros(longest, dtype=torch.uint8)
    own[: len(content)] = torch.frombuffer(bytearray(content), dtype=torch.uint8)
    padded: list[Tensor] = [torch.empty_like(own) for _ in range(size)]
    distributed.all_gather(padded, own)
    return [
        bytes(text[: int(n)].tolist()).decode() for text, n in zip(padded, lengths, strict=True)
    ]
