"""A last solve after training: the last layer, mu_s and mu_2 together, on many points at once.

python -m bench.last_layer RUN ... --flows FLOW.h5 ... --law-weight depth --sigma-surface 0.01 \\
    --without-bottom-row --json last_layer.json

RUN is a folder of granpinn.train or of granpinn.identify_many with its checkpoint. The networks,
their scales and their data are made again from what it holds; flows that config.toml does not name
are found among --flows by the hash in results.json. Each network has one Gauss-Newton step
(bench/last_layer_solve.py) with the terms and sigmas of its training but for what the options say.

Defends: for mu_s <= 0.4 a part of the error of a training is not in the data but in its
weighting: of the law where the pressure is small, of the surface, and of the row at the floor.
These weights were chosen on the networks that they were tried on (docs/tables.md), and at
mu_s = 0.6 they make it worse.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import torch
from torch import Tensor

from bench.last_layer_solve import RIDGE, Data, Features, LawWeight, step
from bench.machine import describe
from granpinn.axes import Axes
from granpinn.command.arguments import read_toml
from granpinn.command.parser import Parser
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, FlowFileError, read_flow
from granpinn.identification.identification import Case, choose_device, members, pose
from granpinn.op_rules import TERMS
from granpinn.recipes import build
from granpinn.results import ResultsFileError, read_results
from granpinn.training import checkpoint
from granpinn.training.checkpoint import CheckpointError
from granpinn.training.problem import Problem, velocity_relaxation
from granpinn.training.scalars import Scalars

REFUSED = (
    ArithmeticError,
    CheckpointError,
    ConfigError,
    FlowFileError,
    OSError,
    ResultsFileError,
)
Device = Literal["auto", "cpu", "cuda"]


class Network(NamedTuple):
    """A trained network: its params [P], theta [3], and the misfit after the pre-fit."""

    case: Case
    params: Tensor
    theta: Tensor
    misfit: float


class Options(NamedTuple):
    """What the solve does differently from the training; sigma_surface None: that of the run."""

    law_weight: LawWeight
    sigma_surface: float | None
    without_bottom_row: bool
    points: int
    surface_points: int
    seed: int
    ridge: float


def networks(folder: Path, flows: dict[str, Path], device: Device) -> Iterator[tuple[str, Network]]:
    """The networks of a run folder and their names, in the order of the batch.

    Args:
        flows: flow files by the SHA-256 of their bytes, for runs that do not name theirs.
        device: to use instead of that of the run.

    Raises:
        ConfigError: the folder does not hold a run with a checkpoint, or the flow is not known.
    """
    found = checkpoint.newest(folder / "checkpoint")
    parts = sorted(path.parent for path in folder.glob("*/results.json"))
    parts = [folder] if (folder / "results.json").exists() else parts
    if found is None or not parts:
        missing = "checkpoint" if found is None else "results.json"
        raise ConfigError(f"{folder} must hold a finished run, has no {missing}: give its folder")
    state = found.state["training"]
    configs = [_config(part, device) for part in parts]
    params, theta = _solutions(found.tensors, bool(state["averaged"]), configs[0])
    if sum(config.members for config in configs) != len(params):
        raise ConfigError(
            f"{folder} must have a results.json for each of the {len(params)} networks of its "
            f"checkpoint, has {len(parts)}: end the run with --resume"
        )
    e = 0
    for part, config in zip(parts, configs, strict=True):
        for k, case in enumerate(members(pose(_flow(part, config, flows), config))):
            name = str(part) if config.members == 1 else f"{part} member {k}"
            if str(e) not in state["lost"]:
                yield name, Network(case, params[e], theta[e], state["misfit"][e])
            e += 1


def _config(folder: Path, device: Device) -> Config:
    return dataclasses.replace(build(read_toml(folder / "config.toml")), device=device)


def _solutions(tensors: dict[str, Tensor], averaged: bool, config: Config) -> tuple[Tensor, Tensor]:
    """params [E, P] and theta [E, 3]: the averages where the schedule has reached them."""
    params, theta = tensors["params"], tensors["theta"]
    if not averaged:
        return params, theta
    scalars = Scalars(config.rheology, theta[:, 2].tolist(), [0] * len(theta), theta)
    return tensors["average.params"], scalars.law(tensors["average.scalars"])


def _flow(folder: Path, config: Config, flows: dict[str, Path]) -> Flow:
    """The flow of a run: that of its hash, wherever it lies now."""
    known = read_results(folder / "results.json").input
    path = flows.get(known.sha256) or (Path(config.flow) if config.flow else None)
    if path is None:
        raise ConfigError(f"{folder} was trained on {known.name}: give that file with --flows")
    flow = read_flow(path)
    if flow.sha256 != known.sha256:
        raise ConfigError(f"{path} is not the {known.name} that {folder} was trained on")
    return flow


def chosen(case: Case, options: Options, device: torch.device) -> Data:
    """The points of the solve: so many at random without repetition, 0: all of them."""
    data = case.member.data
    inside = torch.arange(len(data.points))
    if options.without_bottom_row:
        inside = inside[~bottom_row(case)]
    generator = np.random.default_rng(options.seed)

    def draw(indices: Tensor, count: int) -> Tensor:
        if count == 0 or count >= len(indices):
            return indices
        return indices[generator.choice(len(indices), count, replace=False)]

    i = draw(inside, options.points)
    j = draw(torch.arange(len(data.surface_points)), options.surface_points)
    own = (data.points[i], data.velocity[i], data.point_weights[i])
    surface = (data.surface_points[j], data.surface_pressure[j])
    return Data(*(values.to(device, torch.float64) for values in (*own, *surface)))


def bottom_row(case: Case) -> Tensor:
    """Which training points are those of the lowest row of the grid that has any: bool [N].

    Differences that a measurement or a simulation has taken across the floor make it less exact.
    """
    flow, points = case.flow, case.member.data.points
    if flow.particles is not None or flow.gravity[1] > -abs(flow.gravity[0]):
        raise ConfigError(
            f"--without-bottom-row needs vectors on a grid whose rows are along the floor, and "
            f"{flow.path or 'this flow'} has others: leave it out"
        )
    _, y = Axes.of(flow.gravity).undo(points[:, 0], points[:, 1])
    spacing = float(np.median(np.diff(flow.y))) / case.scales.length
    return torch.as_tensor(y < y.min() + spacing / 2)


def problem_of(network: Network, options: Options) -> Problem:
    """The problem of the training, at its end, with the weight of the surface that is asked for."""
    case, weights = network.case, list(network.case.member.problem.term_weights)
    relaxed = velocity_relaxation(case.config.weights, weights[0], network.misfit, 1.0)
    weights[0] *= float(relaxed)
    if options.sigma_surface is not None:
        weights[TERMS.index("surface")] = options.sigma_surface**-2
    return dataclasses.replace(case.member.problem, term_weights=weights)


def improve(network: Network, options: Options) -> dict[str, Any]:
    """mu_s and mu_2 before and after the step, and their errors where the truth is known."""
    begin = time.monotonic()
    case, device = network.case, choose_device(network.case.config.device)
    problem = problem_of(network, options)
    data = chosen(case, options, device)
    features = Features(problem.spec, network.params.to(device), network.theta.to(device))
    made = step(features, features.start, problem, data, options.law_weight, options.ridge)
    row: dict[str, Any] = {
        "flow": case.flow.path.name if case.flow.path else None,
        "seed": case.member.seed,
        "points": len(data.points),
        "surface_points": len(data.surface_points),
        "loss": made.loss,
        "loss_after": made.loss_after,
    }
    truth = case.flow.truth
    for when, theta in (("trained", network.theta), ("solved", made.unknowns.theta)):
        for name, value in zip(("mu_s", "mu_2"), theta.tolist()[:2], strict=True):
            row[f"{name}_{when}"] = value
            true = getattr(truth, name) if truth else None
            row[f"{name}_{when}_error_percent"] = 100 * (value / true - 1) if true else None
    return row | {"seconds": round(time.monotonic() - begin, 2)}


HEAD = (
    f"{'network':<28}{'mu_s':>18}{'mu_2':>18}{'errors, % before':>20}{'after':>16}"
    f"{'loss':>10}{'after':>10}{'s':>7}"
)


def line(row: dict[str, Any]) -> str:
    def errors(when: str, width: int) -> str:
        both = [row[f"{name}_{when}_error_percent"] for name in ("mu_s", "mu_2")]
        return f"{'/'.join('-' if e is None else f'{e:+.2f}' for e in both):>{width}}"

    values = (f"{row[f'{n}_trained']:.4f} -> {row[f'{n}_solved']:.4f}" for n in ("mu_s", "mu_2"))
    return (
        f"{row['run'][-27:]:<28}{''.join(f'{v:>18}' for v in values)}{errors('trained', 20)}"
        f"{errors('solved', 16)}{row['loss']:10.4f}{row['loss_after']:10.4f}{row['seconds']:7.1f}"
    )


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Medians of the absolute errors of mu_s and mu_2 before and after."""
    found = []
    for when in ("trained", "solved"):
        for name in ("mu_s", "mu_2"):
            errors = [row[f"{name}_{when}_error_percent"] for row in rows]
            sizes = [abs(e) for e in errors if e is not None]
            found.append(statistics.median(sizes) if sizes else math.nan)
    return "median |error| of mu_s/mu_2, %: {:.2f}/{:.2f} before, {:.2f}/{:.2f} after".format(
        *found
    )


def parse(argv: Sequence[str]) -> argparse.Namespace:
    parser = Parser(prog="python -m bench.last_layer", description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("runs", nargs="+", type=Path, metavar="RUN", help="run folders with their checkpoints")
    add("--flows", nargs="+", type=Path, default=[], metavar="FLOW.h5", help="where the flows are")
    add("--law-weight", choices=get_args(LawWeight), default="none", help="see law_weights")
    add("--sigma-surface", type=float, metavar="X", help="dimensionless (that of the run)")
    add("--without-bottom-row", action="store_true", help="leave out the data next to the floor")
    add("--points", type=int, default=24000, metavar="N", help="data points; 0: all (24000)")
    add("--surface-points", type=int, default=5000, metavar="N", help="0: all (5000)")
    add("--seed", type=int, default=0, help="of the choice of points (0)")
    add("--ridge", type=float, default=RIDGE, metavar="X", help=f"see solve ({RIDGE:g})")
    add("--device", choices=get_args(Device), default="auto")
    add("--json", type=Path, metavar="FILE", help="file for the numbers")
    return parser.parse_args(argv)


def run(argv: Sequence[str]) -> int:
    given = parse(argv)
    if given.sigma_surface is not None and not given.sigma_surface > 0:
        raise ConfigError(f"--sigma-surface must be above 0, got {given.sigma_surface:g}")
    options = Options(**{name: getattr(given, name) for name in Options._fields})
    flows = {read_flow(path).sha256: path for path in given.flows}
    rows: list[dict[str, Any]] = []
    print(HEAD)
    for folder in given.runs:
        for name, network in networks(folder, flows, given.device):
            rows.append({"run": name} | improve(network, options))
            print(line(rows[-1]), flush=True)
    print(summary(rows))
    if given.json:
        study = {"machine": describe(), "options": options._asdict(), "rows": rows}
        given.json.write_text(json.dumps(study, indent=1) + "\n")
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code: 0, or 2 with a sentence on what is wrong."""
    try:
        return run(sys.argv[1:] if argv is None else argv)
    except REFUSED as error:
        print(f"bench.last_layer: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
