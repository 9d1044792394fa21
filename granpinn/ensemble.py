"""Many identifications as one batch: cases, seeds, draws of noise, a grid of I0."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from granpinn.config import Config, ConfigError
from granpinn.data import Flow
from granpinn.identification import Case, finish, pose, prepare, start
from granpinn.progress import Progress
from granpinn.results import Result

FlowLike = Flow | str | os.PathLike[str]


def identify_many(
    flows: Sequence[FlowLike],
    config: Config | None = None,
    seeds: Sequence[int] | None = None,
    *,
    I0: Sequence[float] | None = None,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Identify many flows side by side, each as `identify` would, in one batch.

    The members share the settings and so the shape of the network and the schedule; each has its
    own data, seed (of the network, of the batches and of the noise) and I0. Members that are given
    the same flow without noise share its data on the device.

    Args:
        flows: a flow or the path of a flow file for every member.
        config: settings of all, by default the default recipe.
        seeds: one for every member, by default that of the settings.
        I0: likewise.
        run_dir: folder for the checkpoints of the batch and, in 000, 001, ..., what `identify`
            leaves of every member.
        progress: a listener; it is shown the medians over the members.

    Returns:
        The results in the order of `flows`. A member that diverged has a `failure`, and the others
        are not touched by it.

    Raises:
        As `identify`; NonFiniteError if every member diverged.
    """
    begin = time.monotonic()
    config = config or Config()
    if not flows:
        raise ConfigError("flows must hold at least one flow, got none")
    configs = [
        dataclasses.replace(config, seed=seed, I0=value)
        for seed, value in zip(
            _one_each("seeds", seeds, config.seed, len(flows)),
            _one_each("I0", I0, config.I0, len(flows)),
            strict=True,
        )
    ]
    cases = _pose(flows, configs)
    folder: Path | None = None
    parts: list[Path | None] = [None] * len(cases)
    if run_dir is not None:
        folder = prepare(Path(run_dir), config)
        parts = [prepare(folder / f"{e:03d}", case.config) for e, case in enumerate(cases)]
    run = start(cases, config, folder, progress, begin, parts)
    run.train()
    return [finish(case, run, e, parts[e]) for e, case in enumerate(cases)]


T = TypeVar("T")


def _one_each(name: str, values: Sequence[T] | None, default: T, count: int) -> Sequence[T]:
    if values is not None and len(values) != count:
        raise ConfigError(
            f"{name} must have one value for each of {count} flows, got {len(values)}"
        )
    return [default] * count if values is None else values


def _pose(flows: Sequence[FlowLike], configs: Sequence[Config]) -> list[Case]:
    """The cases; a flow that comes again without noise has the data of the first."""
    known: dict[object, Case] = {}
    cases = []
    for flow, config in zip(flows, configs, strict=True):
        key = id(flow) if isinstance(flow, Flow) else str(flow)
        first = known.get(key)
        if first is None:
            case = known[key] = pose(flow, config)
        elif config.noise:
            case = pose(first.flow, config)
        else:
            member = dataclasses.replace(first.member, seed=config.seed, I0=config.I0)
            case = dataclasses.replace(first, config=config, member=member)
        cases.append(case)
    return cases
