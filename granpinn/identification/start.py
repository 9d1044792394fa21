"""The start of a training: its folder, and the loop that trains its cases side by side."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import torch

from granpinn.config import Config, ConfigError
from granpinn.config.toml import to_toml
from granpinn.estimates.confined import undetermined
from granpinn.fit import assumptions
from granpinn.fit.case import Case
from granpinn.output import OutputError, make_folder, write_text
from granpinn.progress import Progress, by_default
from granpinn.results.record import NONE, Check
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Objective
from granpinn.training.room import require_room
from granpinn.training.time_limit import Limit

ERROR_BARS, CHECKS = "error bars", "checks"  # stages after the training
LAST_STEPS = 750  # steps that take as long as the last layer
FIELDS = 200  # steps that take as long as the fields


def start(
    cases: Sequence[Case],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    begin: float,
    device: torch.device,
    members: Sequence[Path | None] | None = None,
    checks: Sequence[Check] = (),
    shown: int = 1,
) -> TrainingLoop:
    """The run that trains the cases side by side; it counts its time limit from `begin`.

    Args:
        checks: that follow; the time limit keeps time for them.
        shown: number of results that are checked.
    """
    everyone = [case.member for case in cases]
    require_room(everyone, config, device)
    objective = Objective(everyone, config.batch, device, config.precision)
    after = shown * sum(check.seconds for check in checks)
    steps = LAST_STEPS if config.optimizer.last_layer else 0
    share = 0.0 if config.checks == NONE else assumptions.share(cases)
    limit = None
    if config.max_time is not None:
        later = config.max_time * share / (1 + share)
        limit = Limit(begin + config.max_time, config.max_time, later, steps + FIELDS, after)
    progress = progress or by_default()
    run = TrainingLoop(objective, config, folder, progress, limit, members)
    many = f"{len(cases)} members, " if len(cases) > 1 else ""
    vectors = sum(len(data.points) for data in objective.distinct)
    walls = sum(len(data.wall_points) for data in objective.distinct)
    between = sum(len(data.between) + len(data.strip) for data in objective.distinct)
    many += f"{vectors} vectors, " + (f"{between} points between them, " if between else "")
    many += f"{walls} points on walls, " if walls else ""
    problems = [case.member.problem for case in cases]
    said = [*(case.sampled for case in cases), *("; ".join(p.symmetries) for p in problems)]
    if any(problem.physics.side_wall > 0 for problem in problems):
        friction = config.side_walls.friction
        said.append(f"side walls: their friction {friction:g} is in the equations")
    for reason in (undetermined(case.seen, config.level) for case in cases):
        if reason is not None:
            said.append(f"warning: no friction coefficient will be determined: {reason}")
    for text in filter(None, dict.fromkeys(said)):
        progress.message(text)
    progress.message(
        f"{many}{len(objective.pool.surface_points)} surface points, "
        f"{objective.spec.n_params} network parameters, {config.dtype} on {device}"
    )
    return run


def folder_of(run_dir: str | os.PathLike[str] | None) -> Path | None:
    """The folder of a run; ConfigError for an empty name, which is no word for the current one."""
    if run_dir is not None and not os.fspath(run_dir):
        raise ConfigError("run_dir must name a folder, got '': the current one is '.'")
    return None if run_dir is None else Path(run_dir)


def prepare(folder: Path, config: Config) -> Path:
    """Make the folder of a run and write config.toml.

    Raises:
        ConfigError: the folder holds another run, or is none.
        OutputError: the folder cannot be made or written to.
    """
    taken = [name for name in ("results.json", "history.csv") if (folder / name).exists()]
    if taken and not config.resume:
        raise ConfigError(
            f"{folder} already holds a run ({taken[0]}): add --resume to continue it, or choose "
            f"another folder"
        )
    make_folder(folder)
    if not (config.resume and (folder / "config.toml").exists()):
        settings = dataclasses.replace(config, resume=False)
        write_text(folder / "config.toml", to_toml(settings))
    return folder


def require_kept(folder: Path) -> None:
    """Raise OutputError if files of a finished run are gone: somebody removed its folder."""
    missing = [name for name in ("config.toml", "results.json") if not (folder / name).exists()]
    if missing:
        raise OutputError(
            f"{folder} was removed during the run (it lacks {' and '.join(missing)}): start again "
            f"with an --out that stays"
        )
