"""From a flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from granpinn import arguments, fields, prediction, problem, results, scoring
from granpinn.atomic import atomic_path
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, add_noise, check_flow, read_flow, training_set
from granpinn.final_loss import final_loss
from granpinn.objective import Member, Objective
from granpinn.parallel import Alone, Processes, processes
from granpinn.problem import Problem
from granpinn.progress import Progress, Silent
from granpinn.results import Parameter, Parameters, Result
from granpinn.run import Run
from granpinn.scales import Scales

AFTER_TRAINING = 30.0  # seconds of a time limit that are kept for fields, figures and report
AFTER_TRAINING_PART = 0.25  # at most this part of a time limit


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

    In a group of processes (granpinn/parallel.py) all work on this one flow; the first one writes.

    Args:
        flow: a flow, or the path of a flow file.
        config: settings, by default the default recipe; its `flow` and `out` are not used.
        run_dir: folder for results.json, fields.h5, history.csv, config.toml and checkpoints;
            without it nothing is written.
        progress: a listener, by default none; `granpinn.progress.automatic()` shows a bar.

    Raises:
        FlowFileError, ConfigError: bad input; the message is one sentence.
        NonFiniteError, CheckpointError: the run cannot go on.
        Interrupted: SIGINT or SIGTERM; a checkpoint has been written where there is a folder.
    """
    begin = time.monotonic()
    case = pose(flow, config or Config())
    together = processes(choose_device(case.config.device))
    folder = None if run_dir is None else Path(run_dir)
    if together.rank > 0:
        progress = None
    elif folder is not None:
        prepare(folder, case.config)
    together.wait()
    run = start([case], case.config, folder, progress, begin, together=together)
    run.train()
    return finish(case, run, 0, folder if together.rank == 0 else None)


@dataclass(frozen=True)
class Case:
    """A flow, the settings to identify it with, and what training sees of it.

    Attributes:
        config: with the seed and the I0 of this case.
    """

    flow: Flow
    config: Config
    scales: Scales
    member: Member


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
    data = training_set(seen, scales, config.level, getattr(torch, config.dtype))
    posed = problem.build(seen, scales, data, config)
    return Case(flow, config, scales, Member(posed, data, config.seed, config.I0))


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
        kept = min(AFTER_TRAINING, AFTER_TRAINING_PART * config.max_time)
        deadline = begin + config.max_time - kept
    progress = progress or Silent()
    run = Run(objective, config, folder, progress, deadline, members, together)
    many = f"{len(cases)} members, " if len(cases) > 1 else ""
    many += f"{together.size} processes, " if together.size > 1 else ""
    progress.message(
        f"{many}{len(objective.points)} points, {len(objective.surface_points)} surface "
        f"points, {objective.spec.n_params} network parameters, {config.dtype} on {device}"
    )
    return run


def finish(
    case: Case, run: Run, member: int, folder: Path | None, keep_fields: bool = True
) -> Result:
    """The result of a trained member, written to its folder where it has one."""
    model = Model(case.member.problem, *run.training.solution(member), case.scales)
    maps = predict(case.flow, model)
    result = _result(case, run, member, model, maps)
    if folder is not None:
        results.write_results(result, folder / "results.json")
        if keep_fields:
            fields.write_fields(maps, folder / "fields.h5")
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


def prepare(folder: Path, config: Config) -> Path:
    """Make the run folder and write config.toml to it; never mix two runs."""
    taken = [name for name in ("results.json", "history.csv") if (folder / name).exists()]
    if taken and not config.resume:
        raise ConfigError(
            f"{folder} already holds a run ({taken[0]}): add --resume to continue it, or choose "
            f"another --out"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not (config.resume and (folder / "config.toml").exists()):
            settings = dataclasses.replace(config, resume=False)
            with atomic_path(folder / "config.toml") as temporary:
                temporary.write_text(arguments.to_toml(settings), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {folder} cannot be written to: {error.strerror}") from None
    return folder


def _result(case: Case, run: Run, member: int, model: Model, maps: fields.Fields) -> Result:
    flow, config, data = case.flow, case.config, case.member.data
    mu_s, mu_2, _ = model.theta.tolist()
    parameters = Parameters(
        Parameter(mu_s, fixed=False), Parameter(mu_2, fixed=False), Parameter(config.I0, fixed=True)
    )
    at_particles = prediction.velocity_at_particles(
        flow, model.problem.spec, model.params, model.problem.physics, model.scales
    )
    scores = scoring.score(flow, maps, parameters, at_particles)
    steps, failure = run.training.step, run.training.lost.get(member)
    return Result(
        parameters=parameters,
        level=config.level,
        form=config.form,
        recipe=config.recipe,
        seed=config.seed,
        data=results.DataSummary(
            n_points=len(data.points),
            n_surface=len(data.surface_points),
            noise=config.noise,
            n_frames=int(flow.t.size),
        ),
        timing=results.Timing(run.wall_s, steps, steps / run.wall_s if run.wall_s else None),
        device=str(run.training.params.device),
        versions=results.versions(),
        input=results.Input(flow.path.name if flow.path else "in memory", flow.sha256),
        settings=dataclasses.asdict(config),
        stopped=run.stopped if failure is None else "diverged",
        failure=failure,
        truth=flow.truth,
        error_percent=scores.error_percent,
        zones=scores.zones,
        inertial_number=scores.inertial_number,
        loss=final_loss(run.training, member),
    )
