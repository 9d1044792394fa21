"""One flow to its friction law: the core that the command line and notebooks share."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from granpinn.config import Config, ConfigError
from granpinn.config.toml import to_toml
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.identification import assumptions, simulated_fields
from granpinn.identification.balance import known_scale
from granpinn.identification.case import Case, choose_device, members, pose
from granpinn.identification.comparison import companions
from granpinn.identification.finish import (
    Concluded,
    conclude,
    parts_of,
    simulated,
    with_assumptions,
    with_fields,
    with_law,
    with_simulated_pressure,
    write_fields_file,
)
from granpinn.identification.identified import Identification, InFolder, InMemory
from granpinn.identification.network import TrainedNetwork
from granpinn.inspection.confined import undetermined
from granpinn.laws import register
from granpinn.output import make_folder, objection_to_folder, owned, write_text
from granpinn.physics.laws import Law
from granpinn.results import Result
from granpinn.second_opinion.threads import threads
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Objective
from granpinn.training.parallel import Processes, processes
from granpinn.training.progress import Progress, by_default
from granpinn.training.room import require_room


@checked
def identify(
    flow: Flow | str | os.PathLike[str],
    config: Config | None = None,
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    law: Law | None = None,
    answered: Callable[[Result], None] | None = None,
    known: Callable[[Result], None] | None = None,
) -> Identification:
    """Identify the friction law of a flow, with its velocity and pressure fields.

    In a group of processes (granpinn/training/parallel.py) all train this flow; the first writes.

    Args:
        flow: a flow, or the path of a flow file.
        config: settings, by default the default recipe; its `flow` and `out` are not used.
        run_dir: folder for results.json, fields.h5, history.csv, config.toml and checkpoints;
            without it nothing is written.
        progress: a listener; by default a bar in a notebook, and none elsewhere.
            `granpinn.training.progress.automatic()` shows a bar in a terminal, `Silent()` nothing.
        law: a law of your own (granpinn/laws.py); by default the one in the settings.
        answered: called with the result once its values and intervals are known.
        known: called with the result once all but the simulated pressure is known and written,
            while the pressure is simulated.

    Returns:
        The result, with the network, its fields, the history and figures.

    Raises:
        FlowFileError, ConfigError, LawError: bad input; the message is one sentence.
        NonFiniteError, CheckpointError: the run cannot go on.
        OutputError: the folder cannot be written to, or another process or thread uses it.
        Interrupted: SIGINT, SIGTERM or SIGHUP; a checkpoint has been written if there is a folder.
    """
    begin, folder = time.monotonic(), folder_of(run_dir)
    config = config or Config()
    if law is not None:
        register(law)
        config = dataclasses.replace(config, law=law.name)
    cases = members(pose(flow, config))
    together = processes(choose_device(config.device))
    with owned(None if together.rank else folder), threads(2) as beside:
        if together.rank > 0:
            progress = None
        elif folder is not None:
            prepare(folder, config, len(cases))
        together.barrier()
        parts = None if len(cases) == 1 else histories(folder, len(cases))
        others = companions(cases[0])
        if others:
            parts = [*(parts or [folder]), *[None] * len(others)]
        run = start([*cases, *others], config, folder, progress, begin, parts, together)
        if run.trainer.params.is_cuda and together.rank == 0:
            made_ahead(cases[:1], beside)
        run.train()
        if all(k in run.trainer.diverged for k in range(len(cases))):
            raise NonFiniteError(run.trainer.diverged[0])
        if together.rank > 0:
            return kept(conclude(cases, run, 0), run)
        (concluded,) = with_assumptions([conclude(cases, run, 0, folder, simulate=True)], run)
        with threads(len(os.sched_getaffinity(0))) as pool:
            simulation = None
            if run.trainer.params.is_cuda:  # the cores of the CPU are idle
                simulation = beside.submit(simulated, concluded, run, pool)
            concluded = with_law(concluded, run)
            if answered is not None:
                answered(concluded.result)
            writing = beside.submit(write_fields_file, concluded)
            if writing.result():
                concluded = with_fields(concluded)
            simulation = simulation or beside.submit(simulated, concluded, run, pool)
            if known is not None:
                known(concluded.result)
            # Written after `known`, which may read the files of the run.
            return kept(with_simulated_pressure(concluded, simulation.result()), run)


def made_ahead(cases: Sequence[Case], beside: Executor) -> list[Future[Any]]:
    """Make what needs no network while a GPU trains, since the CPU has nothing to do.

    The momentum balance needs only the inertial scale of the law, which is seldom identified. What
    fails is made again in its place, and fails there.
    """
    made: list[Future[Any]] = []
    for case in cases:
        scale = known_scale(case.member.law, case.member.fixed)
        if scale is not None:
            made.append(beside.submit(case.balance.at, scale))
        made.append(beside.submit(case.of_flow.surface_sd, case.config.level))
    return made


def kept(concluded: Concluded, run: TrainingLoop) -> Identification:
    """The result with its network, fields and history: those of its folder, else in memory."""
    case, model = concluded.case, concluded.model
    if concluded.folder is not None and concluded.keep_fields:
        return Identification.of(concluded.result, InFolder(concluded.folder, model.law))
    trained, rows = TrainedNetwork.of(model, case.flow), run.histories[concluded.place].rows
    parts = InMemory(trained, case.flow, model.law, rows, concluded.maps)
    return Identification.of(concluded.result, parts)


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
    require_room(everyone, config, device)
    objective = Objective(everyone, config.batch, device, share, config.precision)
    deadline, later = None, 0.0
    if config.max_time is not None:
        limit = config.max_time - simulated_fields.kept_after_training(config, len(cases))
        later = assumptions.seconds(cases, limit)
        deadline = begin + limit - later
    progress = progress or by_default()
    run = TrainingLoop(objective, config, folder, progress, deadline, members, together, later)
    many = f"{len(cases)} members, " if len(cases) > 1 else ""
    many += f"{together.size} processes, " if together.size > 1 else ""
    vectors = sum(len(data.points) for data in objective.distinct)
    walls = sum(len(data.wall_points) for data in objective.distinct)
    between = sum(len(data.between) + len(data.strip) for data in objective.distinct)
    many += f"{vectors} vectors, " + (f"{between} points between them, " if between else "")
    many += f"{walls} points on walls, " if walls else ""
    for sampled in dict.fromkeys(case.sampled for case in cases):
        if sampled is not None:
            progress.message(sampled)
    for words in dict.fromkeys(case.member.problem.symmetries for case in cases):
        if words:
            progress.message("; ".join(words))
    if any(case.member.problem.physics.side_wall > 0 for case in cases):
        progress.message(
            f"side walls: their friction {config.side_walls.friction:g} is in the equations"
        )
    for reason in dict.fromkeys(undetermined(case.seen, config.level) for case in cases):
        if reason is not None:
            progress.message(f"warning: no friction coefficient will be determined: {reason}")
    progress.message(
        f"{many}{len(objective.surface_points)} surface points, "
        f"{objective.spec.n_params} network parameters, {config.dtype} on {device}"
    )
    return run


def folder_of(run_dir: str | os.PathLike[str] | None) -> Path | None:
    """The folder of a run; ConfigError for an empty name, which is no word for the current one."""
    if run_dir is not None and not os.fspath(run_dir):
        raise ConfigError("run_dir must name a folder, got '': the current one is '.'")
    return None if run_dir is None else Path(run_dir)


def prepare(folder: Path, config: Config, members: int = 1) -> Path:
    """Make the folders of a run and write config.toml.

    Raises:
        ConfigError: the folder holds another run, or is none.
        OutputError: the folders cannot be made or written to.
    """
    taken = [
        name for name in ("results.json", "history.csv", "members") if (folder / name).exists()
    ]
    if taken and not config.resume:
        raise ConfigError(
            f"{folder} already holds a run ({taken[0]}): add --resume to continue it, or choose "
            f"another --out"
        )
    if objection := objection_to_folder(folder):
        raise ConfigError(f"--out {objection}")
    for part in parts_of(folder, members):
        make_folder(part)
    if not (config.resume and (folder / "config.toml").exists()):
        settings = dataclasses.replace(config, resume=False)
        write_text(folder / "config.toml", to_toml(settings))
    return folder
