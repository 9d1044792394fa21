"""Errors of the loss and its gradient against float64, for random weights and a trained network.

Near convergence the residuals are far smaller than their terms, so no fixed tolerance fits even
float32: the rule is that the gradient of the mode "fast" errs at most 1.5 times as much as that of
"fp32". Truth and the yardstick "eager float32" come from nested autograd (granpinn.reference).
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from bench.steps import HIDDEN, PHYSICS, make_task
from granpinn import ops, recipes, reference
from granpinn.command.arguments import read_toml
from granpinn.config import ConfigError
from granpinn.identification.identification import Case, pose, start
from granpinn.network import NetworkSpec
from granpinn.simulation import demo_path
from granpinn.training import checkpoint

RULE = 1.5
BATCHES = 8
GRADIENTS = {"loss": 0, "gradient": 2, "gradient_theta": 3}  # index in what the op returns


@dataclass(frozen=True)
class Weighed:
    """A network with data to draw batches from; float32 on the CPU.

    Attributes:
        data: points, velocity and weights [N, .], surface points [M, 3], their pressure [M].
    """

    params: Tensor
    theta: Tensor
    data: tuple[Tensor, Tensor, Tensor, Tensor, Tensor]
    term_weights: list[float]
    spec: NetworkSpec
    physics: list[float]

    def batches(self, interior: int, surface: int) -> Iterator[tuple[Any, ...]]:
        """The arguments of residual_loss for some draws of points."""
        rng = torch.Generator().manual_seed(0)
        for _ in range(BATCHES):
            i = torch.randint(len(self.data[0]), (interior,), generator=rng)
            on_surface = len(self.data[3])
            j = torch.randint(max(on_surface, 1), (surface * bool(on_surface),), generator=rng)
            drawn = [part[i] for part in self.data[:3]] + [part[j] for part in self.data[3:]]
            weights = self.params.new_tensor(self.term_weights)
            spec = (list(self.spec.widths), self.spec.input_shift, self.spec.input_scale)
            yield (self.params, self.theta, *drawn, weights, *spec, self.physics, self.spec.form)


def random_network(form: str) -> Weighed:
    """The network and points of the step benchmark."""
    task = make_task(form, 4096)
    none = task.points[:0]
    data = (task.points, task.velocity, torch.ones_like(task.velocity), none, none[:, 0])
    spec = NetworkSpec(tuple(task.widths), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), form)
    return Weighed(task.params, task.theta, data, [1.0] * 5, spec, PHYSICS)


def trained_network(form: str, steps: int, device: torch.device) -> Weighed:
    """The paper's network after some steps of the default recipe on the demonstration flow."""
    config = recipes.make(form=form, steps=steps, device=device.type, network__widths=tuple(HIDDEN))
    case = pose(demo_path(), config)
    run = start([case], config, None, None, time.monotonic())
    run.train()
    return _weighed(case, *run.training.solution())


def network_of_run(folder: Path) -> Weighed:
    """The network in the newest checkpoint of a run folder, with the data it was trained on."""
    config = recipes.build(read_toml(folder / "config.toml") | {"device": "cpu"})
    found = checkpoint.newest(folder / "checkpoint")
    if found is None or config.flow is None:
        raise ConfigError(f"{folder} must be the folder of a run with a checkpoint and its flow")
    return _weighed(
        pose(config.flow, config), found.tensors["params"][0], found.tensors["theta"][0]
    )


def _weighed(case: Case, params: Tensor, theta: Tensor) -> Weighed:
    seen, problem = case.member.data, case.member.problem
    return Weighed(
        params=params.detach().float().cpu(),
        theta=theta.detach().float().cpu(),
        data=(
            seen.points.float(),
            seen.velocity.float(),
            seen.point_weights.float(),
            seen.surface_points.float(),
            seen.surface_pressure.float(),
        ),
        term_weights=problem.term_weights,
        spec=problem.spec,
        physics=problem.physics,
    )


def errors(network: Weighed, device: torch.device, interior: int, surface: int) -> dict[str, Any]:
    """Median relative L2 errors over some batches, and the ratio that the rule is about."""
    found: dict[str, dict[str, list[float]]] = {}
    loss: Any = ops.residual_loss
    for batch in network.batches(interior, surface):
        arguments: list[Any] = [x.to(device) if isinstance(x, Tensor) else x for x in batch]
        doubles: list[Any] = [x.double() if isinstance(x, Tensor) else x for x in arguments]
        exact = reference.residual_loss(*doubles)
        results = {
            "fp32": loss(*arguments, "fp32"),
            "fast": loss(*arguments, "fast"),
            "eager float32": reference.residual_loss(*arguments),
        }
        for name, result in results.items():
            for quantity, index in GRADIENTS.items():
                error = float((result[index].double() - exact[index]).norm() / exact[index].norm())
                found.setdefault(name, {}).setdefault(quantity, []).append(error)
    out: dict[str, Any] = {
        name: {quantity: statistics.median(values) for quantity, values in by_name.items()}
        for name, by_name in found.items()
    }
    return out | ratios({name: by_name["gradient"] for name, by_name in found.items()})


def ratios(gradient: dict[str, list[float]]) -> dict[str, Any]:
    """Median over the batches of fast / fp32 and of fp32 / eager, and the rule."""

    def ratio(a: str, b: str) -> float:
        pairs = zip(gradient[a], gradient[b], strict=True)
        return statistics.median(x / y if y else float(x > 0) for x, y in pairs)

    fast = ratio("fast", "fp32")
    return {
        "fast_over_fp32": fast,
        "fp32_over_eager": ratio("fp32", "eager float32"),
        "rule_kept": fast <= RULE,
    }


def study(
    device: torch.device, steps: int, run_dir: Path | None, sizes: tuple[int, int]
) -> list[dict[str, Any]]:
    """Both forms with random weights and, with `steps`, trained; a failure is part of its row."""
    rows: list[dict[str, Any]] = []
    cases: list[tuple[str, Callable[[], Weighed]]] = []
    for form in ("strong", "mixed"):
        cases.append((f"random, {form}", partial(random_network, form)))
        if steps:
            trained = f"{steps} steps, {form}"
            cases.append((trained, partial(trained_network, form, steps, device)))
    if run_dir is not None:
        cases.append((f"run {run_dir.name}", partial(network_of_run, run_dir)))
    for name, make in cases:
        try:
            rows.append({"weights": name} | errors(make(), device, *sizes))
        except Exception as error:
            rows.append({"weights": name, "error": f"{type(error).__name__}: {error}"})
    return rows


def text(rows: list[dict[str, Any]]) -> str:
    names = ("eager float32", "fp32", "fast")
    head = f"{'error against float64, loss / gradient':<40}" + "".join(f"{n:>22}" for n in names)
    lines = [head + f"{'fast / fp32':>13}"]
    for row in rows:
        if "error" in row:
            lines.append(f"{row['weights']:<40}{row['error']}")
            continue
        cells = [f"{row[name]['loss']:11.1e} {row[name]['gradient']:.1e}  " for name in names]
        verdict = "" if row["rule_kept"] else f" above {RULE}"
        lines.append(
            f"{row['weights']:<40}"
            + "".join(f"{c:>22}" for c in cells)
            + f"{row['fast_over_fp32']:13.2f}{verdict}"
        )
    return "\n".join(lines)
