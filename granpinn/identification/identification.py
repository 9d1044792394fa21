"""From a flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shutil
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from granpinn import results
from granpinn.atomic import atomic_path
from granpinn.command import arguments
from granpinn.config import Config, ConfigError
from granpinn.data import (
    Flow,
    TrainingSet,
    add_noise,
    check_flow,
    known_sd,
    read_flow,
    redraw,
    training_set,
    with_collocation,
)
from granpinn.identification import closed_fields, conclusion, prediction
from granpinn.results import Result, fields, write_csv
from granpinn.scales import Scales
from granpinn.training import problem
from granpinn.training.guard import NonFiniteError
from granpinn.training.objective import Member, Objective
from granpinn.training.parallel import Alone, Processes, processes
from granpinn.training.problem import Problem
from granpinn.training.progress import Progress, Silent
from granpinn.training.run import Run


@dataclass(frozen=True)
class Model:
    """A trained network with the friction law that was identified with it.

    Attributes:
        problem: network and constants of the residuals.
        params: parameters of the network [P].
        theta: (mu_s, mu_2, I0) [3].
        scales: units of everything dimensionless.
    """

    problem: Problem
    params: Tensor
    theta: Tensor
    scales: Scales


def identify(
    flow: Flow | str | os.PathLike[str],
    config: Config | None = None,
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Result:
    """Identify mu_s and mu_2 of a flow, with the velocity and pressure fields that go with them.

    In a group of processes (training/parallel.py) all work on this one flow; the first one writes.

    Args:
        flow: a flow, or the path of a flow file.
        config: settings, by default the default recipe; its `flow` and `out` are not used.
        run_dir: folder for results.json, fields.h5, history.csv, config.toml and checkpoints;
            without it nothing is written.
        progress: a listener, by default none; `granpinn.training.progress.automatic()` shows a bar.

    Raises:
        FlowFileError, ConfigError: bad input; the message is one sentence.
        NonFiniteError, CheckpointError: the run cannot go on.
        Interrupted: SIGINT or SIGTERM; a checkpoint has been written where there is a folder.
    """
    begin = time.monotonic()
    config = config or Config()
    cases = members(pose(flow, config))
    together = processes(choose_device(config.device))
    folder = None if run_dir is None else Path(run_dir)
    if together.rank > 0:
        progress = None
    elif folder is not None:
        prepare(folder, config, len(cases))
    together.wait()
    parts = None if len(cases) == 1 else histories(folder, len(cases))
    run = start(cases, config, folder, progress, begin, parts, together)
    run.train()
    if len(run.training.lost) == len(cases):
        raise NonFiniteError(next(iter(run.training.lost.values())))
    if together.rank > 0:
        return finish(cases, run, 0, None, None)
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as closing:
        return finish(cases, run, 0, folder, closing)


@dataclass(frozen=True)
class Case:
    """A flow, the settings to identify it with, and what training sees of it.

    Attributes:
        config: with the seed and the I0 of this case.
        seen: the flow as training sees it, with added noise.
        known_sd: rms standard deviation of its velocity, in the units of the file; 0: not known.
        redrawn: whether its data have the known noise once more.
    """

    flow: Flow
    config: Config
    scales: Scales
    member: Member
    seen: Flow
    known_sd: float
    redrawn: bool = False


def training_data(flow: Flow, scales: Scales, config: Config) -> TrainingSet:
    """What the network is fitted to: the data of a flow, and points between them for the equations.

    Raises:
        FlowFileError: the flow has not what the level needs.
    """
    data = training_set(flow, scales, config.level, getattr(torch, config.dtype))
    return with_collocation(data, flow, scales, config.batch.collocation)


def pose(flow: Flow | str | os.PathLike[str], config: Config) -> Case:
    """Read and check a flow, and make the problem that the training solves."""
    choose_device(config.device)
    if isinstance(flow, Flow):
        check_flow(flow)
    else:
        flow = read_flow(flow)
    # What training sees has neither the true parameters nor the reference pressure.
    seen = dataclasses.replace(flow, truth=None, p=None)
    seen = add_noise(seen, config.noise, config.seed)
    scales = Scales.from_flow(seen)
    data = training_data(seen, scales, config)
    posed = problem.build(seen, scales, data, config)
    member = Member(posed, data, config.seed, config.I0)
    return Case(flow, config, scales, member, seen, known_sd(seen))


def members(case: Case) -> list[Case]:
    """The ensemble of a case: its first member, and others that differ in their seeds.

    Where the noise of the data is known, the second half gets it once more (uncertainty.py).
    """
    config, made = case.config, [case]
    for k in range(1, config.members):
        member = dataclasses.replace(case.member, seed=member_seed(config.seed, k))
        redrawn = case.known_sd > 0 and 2 * k >= config.members
        if redrawn:
            seen = redraw(case.seen, config.noise, member.seed)
            data = training_data(seen, case.scales, config)
            member = dataclasses.replace(member, data=data)
        made.append(dataclasses.replace(case, member=member, redrawn=redrawn))
    return made


def member_seed(seed: int, k: int) -> int:
    """The seed of member k of an ensemble, in [0, 2^63); that of member 0 is the given one.

    Hashed, so that ensembles of neighboring seeds have no member in common.
    """
    if k == 0:
        return seed
    digest = hashlib.sha256(f"{seed} {k}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def parts_of(folder: Path, count: int) -> list[Path]:
    """The folders of the histories of `count` members of a run."""
    return [folder] if count == 1 else [folder / "members" / f"{k:02d}" for k in range(count)]


def histories(folder: Path | None, count: int) -> list[Path | None]:
    """The same; None for each where there is no run folder."""
    return [None] * count if folder is None else [*parts_of(folder, count)]


def start(
    cases: Sequence[Case],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    begin: float,
    members: Sequence[Path | None] | None = None,
    together: Processes | None = None,
) -> Run:
    """The run that trains the cases side by side; it counts its time limit from `begin`."""
    device = choose_device(config.device)
    together = together or Alone()
    share = (together.rank, together.size)
    everyone = [case.member for case in cases]
    objective = Objective(everyone, config.batch, device, share, config.precision)
    deadline = None
    if config.max_time is not None:
        kept = closed_fields.kept_after_training(config, len(cases))
        deadline = begin + config.max_time - kept
    progress = progress or Silent()
    run = Run(objective, config, folder, progress, deadline, members, together)
    many = f"{len(cases)} members, " if len(cases) > 1 else ""
    many += f"{together.size} processes, " if together.size > 1 else ""
    vectors = sum(len(data.points) for data in objective.distinct)
    between = len(objective.points) - vectors
    many += f"{vectors} vectors, " + (f"{between} points between them, " if between else "")
    progress.message(
        f"{many}{len(objective.surface_points)} surface points, "
        f"{objective.spec.n_params} network parameters, {config.dtype} on {device}"
    )
    return run


def finish(
    cases: Sequence[Case],
    run: Run,
    first: int,
    folder: Path | None,
    closing: Executor | None,
    keep_fields: bool = True,
) -> Result:
    """The result of an ensemble, the members of the run from `first` on, written to its folder.

    The threads of `closing` close the pressure; None leaves that out.
    """
    found, place = conclusion.members_of(cases, run, first)
    case, e = cases[place], first + place
    model = Model(case.member.problem, *run.training.solution(e), case.scales)
    maps, record = predict(case.flow, model), None
    if case.config.closure.frames and closing is not None:
        maps, record = closed_fields.close(case, run, model, maps, closing)
    result = conclusion.result(case, run, e, found, model, maps, record)
    if folder is not None:
        results.write_results(result, folder / "results.json")
        write_csv(result, folder / "results.csv")
        if keep_fields:
            fields.write_fields(maps, folder / "fields.h5")
        if len(cases) > 1:
            shown = parts_of(folder, len(cases))[place]
            with atomic_path(folder / "history.csv") as temporary:
                shutil.copyfile(shown / "history.csv", temporary)
    return result


def predict(flow: Flow, model: Model) -> fields.Fields:
    """The fields of a model at the points of a flow, in its units."""
    p = model.problem
    return prediction.predict(flow, p.spec, model.params, model.theta, p.physics, model.scales)


def choose_device(name: str) -> torch.device:
    """The device of "auto", "cpu" or "cuda"; ConfigError where there is no such thing."""
    kernels = torch._C._dispatch_has_kernel_for_dispatch_key("granpinn::residual_loss", "CUDA")
    if name == "cuda" and not kernels:
        raise ConfigError(
            "--device cuda needs the CUDA kernels, which this granpinn was built without: build it "
            "where nvcc is, or use --device cpu"
        )
    if name == "cuda" and not torch.cuda.is_available():
        raise ConfigError(
            "--device cuda needs a GPU that torch can use, and torch.cuda.is_available() is false: "
            "python -m granpinn.doctor says why; or use --device cpu"
        )
    usable = kernels and torch.cuda.is_available()
    return torch.device("cuda" if usable and name != "cpu" else "cpu")


def prepare(folder: Path, config: Config, members: int = 1) -> Path:
    """Make the folder of a run of so many members and write config.toml; never mix two runs."""
    taken = [
        name for name in ("results.json", "history.csv", "members") if (folder / name).exists()
    ]
    if taken and not config.resume:
        raise ConfigError(
            f"{folder} already holds a run ({taken[0]}): add --resume to continue it, or choose "
            f"another --out"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for part in parts_of(folder, members):
            part.mkdir(parents=True, exist_ok=True)
        if not (config.resume and (folder / "config.toml").exists()):
            settings = dataclasses.replace(config, resume=False)
            with atomic_path(folder / "config.toml") as temporary:
                temporary.write_text(arguments.to_toml(settings), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {folder} cannot be written to: {error.strerror}") from None
    return folder
