"""One flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import os
import shutil
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path

from granpinn import results
from granpinn.atomic import atomic_path
from granpinn.config import Config, ConfigError
from granpinn.config.toml import to_toml
from granpinn.data import Flow
from granpinn.identification import conclusion, prediction, simulated_fields
from granpinn.identification.case import Case, Model, choose_device, members, pose
from granpinn.physics.laws import LAWS
from granpinn.results import Result, fields, write_csv
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Objective
from granpinn.training.parallel import Processes, processes
from granpinn.training.progress import Progress, Silent


def identify(
    flow: Flow | str | os.PathLike[str],
    config: Config | None = None,
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Result:
    """Identify the friction law of a flow, with its velocity and pressure fields.

    In a group of processes (granpinn/training/parallel.py) all train this flow; the first writes.

    Args:
        flow: a flow, or the path of a flow file.
        config: settings, by default the default recipe; its `flow` and `out` are not used.
        run_dir: folder for results.json, fields.h5, history.csv, config.toml and checkpoints;
            without it nothing is written.
        progress: a listener, by default none; `granpinn.training.progress.automatic()` shows a bar.

    Raises:
        FlowFileError, ConfigError: bad input; the message is one sentence.
        NonFiniteError, CheckpointError: the run cannot go on.
        Interrupted: SIGINT or SIGTERM; a checkpoint has been written if there is a folder.
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
    together.barrier()
    parts = None if len(cases) == 1 else histories(folder, len(cases))
    run = start(cases, config, folder, progress, begin, parts, together)
    run.train()
    if len(run.trainer.diverged) == len(cases):
        raise NonFiniteError(next(iter(run.trainer.diverged.values())))
    if together.rank > 0:
        return finish(cases, run, 0, None, None)
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return finish(cases, run, 0, folder, pool)


def parts_of(folder: Path, count: int) -> list[Path]:
    """The folders of the histories of `count` members of a run."""
    return [folder] if count == 1 else [folder / "members" / f"{k:02d}" for k in range(count)]


def histories(folder: Path | None, count: int) -> list[Path | None]:
    """The folders of the histories of `count` members; None for each without a run folder."""
    return [None] * count if folder is None else [*parts_of(folder, count)]


def start(
    cases: Sequence[Case],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    begin: float,
    members: Sequence[Path | None] | None = None,
    together: Processes | None = None,
) -> TrainingLoop:
    """The run that trains the cases side by side; it counts its time limit from `begin`."""
    device = choose_device(config.device)
    together = together or Processes()
    share = (together.rank, together.size)
    everyone = [case.member for case in cases]
    objective = Objective(everyone, config.batch, device, share, config.precision)
    deadline = None
    if config.max_time is not None:
        kept = simulated_fields.kept_after_training(config, len(cases))
        deadline = begin + config.max_time - kept
    progress = progress or Silent()
    run = TrainingLoop(objective, config, folder, progress, deadline, members, together)
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
    run: TrainingLoop,
    first: int,
    folder: Path | None,
    pool: Executor | None,
    keep_fields: bool = True,
) -> Result:
    """The result of an ensemble, the members of the run from `first` on, written to its folder.

    The threads of `pool` simulate the pressure; None: without a simulated pressure.
    """
    found, place = conclusion.members_of(cases, run, first)
    case, e = cases[place], first + place
    law = LAWS[case.config.law]
    model = Model(case.member.problem, *run.trainer.solution(e), case.scales, law)
    maps, record = prediction.predict(case.flow, model), None
    if case.config.simulated_pressure.frames and pool is not None:
        maps, record = simulated_fields.add(case, run, model, maps, pool)
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


def prepare(folder: Path, config: Config, members: int = 1) -> Path:
    """Make the folders of a run and write config.toml; ConfigError if they hold another run."""
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
                temporary.write_text(to_toml(settings), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {folder} cannot be written to: {error.strerror}") from None
    return folder
