"""From a flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import os
import time
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from granpinn import arguments, fields, prediction, problem, results, scoring
from granpinn.atomic import atomic_path
from granpinn.config import Config, ConfigError
from granpinn.data import Flow, add_noise, check_flow, read_flow, training_set
from granpinn.objective import Objective
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
    config = config or Config()
    device = choose_device(config.device)
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
    objective = Objective(posed, data, config.batch, config.seed, device)
    deadline = None
    if config.max_time is not None:
        kept = min(AFTER_TRAINING, AFTER_TRAINING_PART * config.max_time)
        deadline = begin + config.max_time - kept
    folder = None if run_dir is None else _prepare(Path(run_dir), config)
    progress = progress or Silent()
    run = Run(objective, config, folder, progress, deadline)
    progress.message(
        f"{len(objective.points)} points, {len(objective.surface_points)} surface points, "
        f"{posed.spec.n_params} network parameters, {config.dtype} on {device}"
    )
    run.train()

    model = Model(posed, *run.training.solution(), scales)
    maps = predict(flow, model)
    result = _result(flow, config, run, model, maps)
    if folder is not None:
        results.write_results(result, folder / "results.json")
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


def _prepare(folder: Path, config: Config) -> Path:
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


def _result(flow: Flow, config: Config, run: Run, model: Model, maps: fields.Fields) -> Result:
    mu_s, mu_2, _ = model.theta.tolist()
    parameters = Parameters(
        Parameter(mu_s, fixed=False), Parameter(mu_2, fixed=False), Parameter(config.I0, fixed=True)
    )
    p = model.problem
    at_particles = prediction.velocity_at_particles(
        flow, p.spec, model.params, p.physics, model.scales
    )
    scores = scoring.score(flow, maps, parameters, at_particles)
    steps = run.training.step
    return Result(
        parameters=parameters,
        level=config.level,
        form=config.form,
        recipe=config.recipe,
        seed=config.seed,
        data=results.DataSummary(
            n_points=len(run.training.objective.points),
            n_surface=len(run.training.objective.surface_points),
            noise=config.noise,
            n_frames=int(flow.t.size),
        ),
        timing=results.Timing(run.wall_s, steps, steps / run.wall_s if run.wall_s else None),
        device=str(run.training.params.device),
        versions=results.versions(),
        input=results.Input(flow.path.name if flow.path else "in memory", flow.sha256),
        settings=dataclasses.asdict(config),
        stopped=run.stopped,
        truth=flow.truth,
        error_percent=scores.error_percent,
        zones=scores.zones,
        inertial_number=scores.inertial_number,
    )
