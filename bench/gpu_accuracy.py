"""Errors of the loss and its gradient against float64, for random weights and trained networks.

Near convergence the residuals are far smaller than their terms, so no fixed tolerance fits even
float32. The rule: the gradient in mode "fast" errs at most 1.5 times as much as in mode "fp32". The
ratio of two rounding errors is mostly chance, and the rounding of the weights is the same in every
batch. So the ratio is a median over copies of the network whose weights differ by COPIED; for each
copy it is a median over some batches.

The reference is the float64 kernels, which the row itself compares with nested autograd in float64
(granpinn.reference). "eager float32" is nested autograd for the network without changed weights.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch
from torch import Tensor
from torch.utils._pytree import tree_map_only

from bench.steps import HIDDEN, PHYSICS, make_task
from granpinn import reference
from granpinn.config import Config, Network
from granpinn.fit.case import Case, pose
from granpinn.identification.start import start
from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.terms import LossPoints
from granpinn.simulation import demo_path

RULE = 1.5
BATCHES = 8
COPIES = 8
COPIED = 1e-6  # standard deviation of the relative change of a weight: eight epsilons of float32
QUANTITIES = {"loss": 0, "gradient": 2, "gradient_theta": 3}  # index in the results of the op


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

    def copies(self, count: int) -> Iterator[Tensor]:
        """Copies of the parameters with random, small relative changes."""
        for seed in range(count):
            rng = torch.Generator().manual_seed(seed)
            change = torch.randn(self.params.shape, generator=rng, dtype=torch.float64)
            yield (self.params.double() * (1 + COPIED * change)).float()


def random_network(form: str) -> Weighed:
    """The network and points of the step benchmark."""
    task = make_task(form, 4096)
    return Weighed(task.params, task.theta, task.batch, [1.0] * 5, task.spec, PHYSICS)


def trained_network(form: str, steps: int, device: torch.device) -> Weighed:
    """The paper's network after some steps of the default recipe on the demonstration flow."""
    changes: dict[str, Any] = {"form": form, "steps": steps, "device": device.type}
    config = Config(network=Network(widths=tuple(HIDDEN)), **changes)
    case = pose(demo_path(), config)
    run = start([case], config, None, None, time.monotonic())
    run.train()
    return _weighed(case, *run.trainer.solution())


def _weighed(case: Case, params: Tensor, theta: Tensor) -> Weighed:
    problem = case.member.problem
    return Weighed(
        params=params.detach().float().cpu(),
        theta=theta.detach().float().cpu(),
        data=tree_map_only(Tensor, Tensor.float, case.member.data.loss_points),
        term_weights=problem.term_weights,
        spec=problem.spec,
        physics=problem.physics,
    )


def errors(
    network: Weighed, device: torch.device, interior: int, surface: int, copies: int = COPIES
) -> dict[str, Any]:
    """Median relative L2 errors of a network over some batches, and the ratios of its copies.

    Returns:
        the errors by mode; "float64", the errors of the reference against nested autograd in one
        batch; and the result of `ratios`.
    """
    batches = tree_map_only(
        Tensor, lambda x: x.to(device), list(network.batches(interior, surface))
    )
    own = _gradient_errors(network, network.params.to(device), batches, eager=True)
    out: dict[str, Any] = {
        name: {quantity: statistics.median(values) for quantity, values in by_name.items()}
        for name, by_name in own.items()
    }
    others = [
        _gradient_errors(network, params.to(device), batches) for params in network.copies(copies)
    ]
    gradients = [
        {name: by_name["gradient"] for name, by_name in found.items()} for found in [own, *others]
    ]
    return out | ratios(gradients[0], gradients[1:])


def _gradient_errors(
    network: Weighed, params: Tensor, batches: list[tuple[Any, ...]], eager: bool = False
) -> dict[str, dict[str, list[float]]]:
    """Relative errors against the float64 kernels: by mode and quantity, one of each batch.

    `eager` adds nested autograd in float32, and in float64 for the first batch.
    """
    found: dict[str, dict[str, list[float]]] = {}
    loss: Any = ops.residual_loss
    theta = network.theta.to(params.device)
    for k, batch in enumerate(batches):
        arguments = (params, theta, *batch)
        doubles = tree_map_only(Tensor, Tensor.double, arguments)
        exact = loss(*doubles)
        results = {mode: loss(*arguments, precision=mode) for mode in ("fp32", "fast")}
        if eager:
            results["eager float32"] = reference.residual_loss(*arguments)
            if k == 0:
                results["float64"] = reference.residual_loss(*doubles)
        for name, result in results.items():
            for quantity, index in QUANTITIES.items():
                error = float((result[index].double() - exact[index]).norm() / exact[index].norm())
                found.setdefault(name, {}).setdefault(quantity, []).append(error)
    return found


def ratios(own: dict[str, list[float]], copies: list[dict[str, list[float]]]) -> dict[str, Any]:
    """Ratios of gradient errors [batches] of the modes: fast / fp32, fp32 / eager, and the rule.

    Args:
        own: errors of the network without changes, with "eager float32".
        copies: errors of its copies; the rule uses their median, or the network if there are none.

    Returns:
        "fast_over_fp32", its range over the copies, its value for the network "as_it_is", and all
        values: "ratios" [copies][batches].
    """
    every = [_quotients(errors["fast"], errors["fp32"]) for errors in copies or [own]]
    medians = [statistics.median(row) for row in every]
    fast = statistics.median(medians)
    return {
        "fast_over_fp32": fast,
        "fast_over_fp32_range": [min(medians), max(medians)],
        "fast_over_fp32_as_it_is": statistics.median(_quotients(own["fast"], own["fp32"])),
        "fp32_over_eager": statistics.median(_quotients(own["fp32"], own["eager float32"])),
        "rule_kept": fast <= RULE,
        "copies": len(copies),
        "ratios": every,
    }


def _quotients(a: list[float], b: list[float]) -> list[float]:
    """a / b one by one; 0 / 0 is 0, as neither has an error."""
    return [x / y if y else float(x > 0) for x, y in zip(a, b, strict=True)]


def study(device: torch.device, steps: int, sizes: tuple[int, int]) -> list[dict[str, Any]]:
    """Both forms with random weights and, with `steps`, trained; a failure is part of its row."""
    rows: list[dict[str, Any]] = []
    cases: list[tuple[str, Callable[[], Weighed], int]] = []
    for form in ("strong", "mixed"):
        cases.append((f"random, {form}", partial(random_network, form), 0))
        if steps:
            trained = f"{steps} steps, {form}"
            cases.append((trained, partial(trained_network, form, steps, device), COPIES))
    for name, make, copies in cases:
        begin = time.monotonic()
        try:
            found = errors(make(), device, *sizes, copies)
            rows.append({"weights": name} | found | {"seconds": time.monotonic() - begin})
        except Exception as error:
            rows.append({"weights": name, "error": f"{type(error).__name__}: {error}"})
    return rows


def text(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return ""
    names = ("eager float32", "fp32", "fast")
    head = f"{'error against float64, loss / gradient':<40}" + "".join(f"{n:>22}" for n in names)
    lines = [head + f"{'fast / fp32':>13}"]
    for row in rows:
        if "error" in row:
            lines.append(f"{row['weights']:<40}{row['error']}")
            continue
        cells = [f"{row[name]['loss']:11.1e} {row[name]['gradient']:.1e}  " for name in names]
        line = f"{row['weights']:<40}" + "".join(f"{c:>22}" for c in cells)
        line += f"{row['fast_over_fp32']:13.2f}"
        if row["copies"]:  # near convergence, where the rule applies
            low, high = row["fast_over_fp32_range"]
            line += f" ({low:.2f} to {high:.2f} over {row['copies']} copies)"
            line += "" if row["rule_kept"] else f" above {RULE}"
        lines.append(line)
    return "\n".join(lines)
