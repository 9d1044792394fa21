"""Errors of the gradient of the loss against float64, for networks near the end of a training.

Near convergence the residuals are far smaller than their terms, so no fixed tolerance fits even
float32. The rule: the gradient in mode "fast" errs at most 1.5 times as much as in mode "fp32". The
ratio of two rounding errors is mostly chance, and the rounding of the weights is the same in every
batch. So the ratio is a median over copies of the network whose weights differ by COPIED; for each
copy it is a median over some batches.

The reference is the float64 kernels, which tests/kernels/test_accuracy.py compares with nested
autograd. The same tests hold for random weights.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.utils._pytree import tree_map_only

from bench.steps import HIDDEN
from granpinn.config import Config, Network
from granpinn.fit.case import pose
from granpinn.identification.start import start
from granpinn.kernels import ops
from granpinn.kernels.builds import choose_device
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.terms import LossPoints
from granpinn.simulation import demo_path

RULE = 1.5
BATCHES = 8
COPIES = 8
COPIED = 1e-6  # standard deviation of the relative change of a weight: eight epsilons of float32
GRADIENT = 2  # index in the results of the op


@dataclass(frozen=True)
class Weighed:
    """A network with data to draw batches from; float32 on the CPU.

    Attributes:
        data: N points and M surface points.
    """

    params: Tensor
    theta: Tensor
    data: LossPoints
    term_weights: list[float]
    spec: NetworkSpec
    physics: Sequence[float]

    def batches(self, interior: int, surface: int) -> Iterator[tuple[Any, ...]]:
        """The arguments of residual_loss after the first two, for some draws of points."""
        rng = torch.Generator().manual_seed(0)
        for _ in range(BATCHES):
            i = torch.randint(len(self.data.points), (interior,), generator=rng)
            on_surface = len(self.data.surface_points)
            j = torch.randint(max(on_surface, 1), (surface * bool(on_surface),), generator=rng)
            weights = self.params.new_tensor(self.term_weights)
            yield self.data.at(i, j), weights, self.spec, self.physics

    def copies(self) -> Iterator[Tensor]:
        """Copies of the parameters with random, small relative changes."""
        for seed in range(COPIES):
            rng = torch.Generator().manual_seed(seed)
            change = torch.randn(self.params.shape, generator=rng, dtype=torch.float64)
            yield (self.params.double() * (1 + COPIED * change)).float()


def trained_network(form: str, steps: int, device: torch.device) -> Weighed:
    """The paper's network after some steps of the default recipe on the demonstration flow."""
    changes: dict[str, Any] = {"form": form, "steps": steps, "device": device.type}
    config = Config(network=Network(widths=tuple(HIDDEN)), **changes)
    case = pose(demo_path(), config)
    run = start([case], config, None, None, time.monotonic(), choose_device(config.device))
    run.train()
    params, theta = (x.detach().float().cpu() for x in run.trainer.solution())
    problem, data = case.member.problem, case.member.data.loss_points
    data = tree_map_only(Tensor, Tensor.float, data)
    return Weighed(params, theta, data, problem.term_weights, problem.spec, problem.physics)


def ratios(
    network: Weighed, device: torch.device, interior: int, surface: int
) -> list[list[float]]:
    """Error of the gradient in mode "fast" over that in mode "fp32", [copies][batches]."""
    loss: Any = ops.residual_loss

    def ratio(*arguments: Any) -> float:
        arguments = tree_map_only(Tensor, lambda x: x.to(device), arguments)
        exact = loss(*tree_map_only(Tensor, Tensor.double, arguments))[GRADIENT]
        fast, fp32 = (
            float((loss(*arguments, precision=mode)[GRADIENT].double() - exact).norm())
            for mode in ("fast", "fp32")
        )
        return fast / fp32 if fp32 else float(fast > 0)  # 0 / 0 is 0: neither has an error

    batches = list(network.batches(interior, surface))
    return [
        [ratio(params, network.theta, *batch) for batch in batches] for params in network.copies()
    ]


def judged(values: Sequence[Sequence[float]]) -> dict[str, Any]:
    """The median over the copies of the medians over their batches, its range, and the rule."""
    medians = [statistics.median(row) for row in values]
    fast = statistics.median(medians)
    return {"ratio": fast, "range": [min(medians), max(medians)], "rule_kept": fast <= RULE}


def study(device: torch.device, steps: int, sizes: tuple[int, int]) -> list[dict[str, Any]]:
    """Both forms after some steps of training."""
    return [
        {"form": form, "steps": steps}
        | judged(ratios(trained_network(form, steps, device), device, *sizes))
        for form in ("strong", "mixed")
    ]
