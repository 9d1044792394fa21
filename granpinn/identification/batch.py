"""Many identifications as one batch: cases, seeds, draws of noise, a grid of I0."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import wait
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeVar

from granpinn import results
from granpinn.checks import momentum_balance, wanted
from granpinn.checks.comparison_of_laws import companions
from granpinn.config import Config, ConfigError
from granpinn.config.settings import config_of
from granpinn.data import Flow
from granpinn.declared import checked
from granpinn.fit.case import Case, choose_device, fixed_values, members, posed, sound
from granpinn.fit.context import Context
from granpinn.identification import answer
from granpinn.identification.identified import Identification, in_folder
from granpinn.identification.start import (
    CHECKS,
    ERROR_BARS,
    folder_of,
    histories,
    prepare,
    start,
)
from granpinn.output import owned
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.record import make
from granpinn.simulation.threads import threads
from granpinn.training.parallel import gather_texts, processes
from granpinn.training.progress import Progress

FlowLike = Flow | str | os.PathLike[str]

# Threads that hold Python wait for each other, 5 ms at a time: 30 members took 31 s after their
# training with 16 threads, 20 s with 4 and 22 s with 2 (bench/studies/performance/note.md).
SIDE_BY_SIDE = 4


@checked
def identify_many(
    flows: Sequence[FlowLike],
    config: Config | Mapping[str, Any] | None = None,
    seeds: Sequence[int] | None = None,
    *,
    I0: Sequence[float] | None = None,
    laws: Sequence[str] | None = None,
    noise: Sequence[float] | None = None,
    run_dir: str | os.PathLike[str] | None = None,
    keep_fields: bool = True,
    progress: Progress | None = None,
    **settings: Any,
) -> list[Identification]:
    """Identify many flows side by side, each as `identify` would, in one batch.

    Checks that train more networks are left out.

    The members share the settings, hence the shape of the network and the schedule. Each has its
    own data, friction law, I0 and seed (of the network, of the batches and of the noise). Members
    with the same flow and without noise share its data on the device. With `config.members` = K,
    each member is an ensemble of K networks. In a group of processes
    (granpinn/training/parallel.py) each process trains its own members, and all return all results.

    Args:
        flows: a flow or the path of a flow file for every member.
        config: settings of all as a `Config` or a dict, by default the default recipe.
        settings: single ones, which win, such as `steps=6000`.
        seeds, I0, laws, noise: one value for every member, by default the value in the settings.
        run_dir: folder for the checkpoints of the batch. Its subfolders 000, 001, ... get the files
            that `identify` writes, one subfolder for each member.
        keep_fields: whether to write fields.h5, tens of megabytes for each member.
        progress: a listener, as in `identify`; it gets the medians over the members.

    Returns:
        The results in the order of `flows`. A member that diverged has a `failure`; the others
        continue. Without a folder, fields are predicted when they are asked for, without the
        simulated pressure; in a group of processes there are then no fields and no networks.

    Raises:
        As `identify`, except NonFiniteError.
    """
    begin = time.monotonic()
    config = config_of(config, settings)
    root, checks = folder_of(run_dir), [check for check in wanted(config) if not check.trains]
    if not flows:
        raise ConfigError("flows must hold at least one flow, got none")
    configs = [
        dataclasses.replace(config, seed=seed, I0=value, law=law, noise=sd)
        for seed, value, law, sd in zip(
            _one_each("seeds", seeds, config.seed, len(flows)),
            _one_each("I0", I0, config.I0, len(flows)),
            _one_each("laws", laws, config.law, len(flows)),
            _one_each("noise", noise, config.noise, len(flows)),
            strict=True,
        )
    ]
    group = processes(choose_device(config.device))
    with owned(None if group.rank else root), ExitStack() as at_end:
        if root is not None and group.rank == 0:
            prepare(root, config)
        group.barrier()
        own = range(group.rank, len(flows), group.size)
        cases = _pose([flows[e] for e in own], [configs[e] for e in own])
        folder = root
        parts: list[Path | None] = [None] * len(cases)
        if root is not None:
            if group.size > 1:
                folder = prepare(root / f"process-{group.rank}", config)
            parts = [
                prepare(root / f"{e:03d}", case.config, config.members)
                for e, case in zip(own, cases, strict=True)
            ]
        found: list[Identification] = []
        if cases:
            K = config.members
            every = [member for case in cases for member in members(case)]
            places = [place for part in parts for place in histories(part, K)]
            others = [companions(case) for case in cases]
            every += [other for own in others for other in own]
            places += [None] * (len(every) - len(places))
            listener = progress if group.rank == 0 else None
            run = start(every, config, folder, listener, begin, places, None, checks, len(cases))
            at_end.callback(run.progress.stop)
            with threads(1) as beside:
                ahead = []
                if run.trainer.params.is_cuda:  # the cores of the CPU are idle
                    ahead = [beside.submit(momentum_balance.prepare, case) for case in cases]
                run.train()
                for later in ahead:  # what has not begun is made by all cores, in its place
                    later.cancel()
            behind = [len(cases) * K + sum(map(len, others[:e])) for e in range(len(cases))]
            run.progress.stage(ERROR_BARS)

            def valued(e: int) -> Context:
                ensemble, first = every[e * K : (e + 1) * K], e * K
                context = answer.valued(
                    cases[e].flow, ensemble, run, first, checks, parts[e], keep_fields, behind[e]
                )
                answer.with_fields(context)
                context.fields = None  # those of all members would not fit into memory
                return context

            contexts = _side_by_side(valued, range(len(cases)), config.device)
            answer.with_intervals(contexts, run)
            run.progress.stage(CHECKS)
            # One pool for all members: every core simulates as long as frames are left.
            with threads(max(1, _cores() // group.size)) as pool:

                def finished(context: Context) -> Identification:
                    answer.with_curve(context)
                    context.pool = pool
                    make(context, checks)
                    return answer.kept(context)

                found = _side_by_side(finished, contexts, config.device)
        return found if group.size == 1 else _in_order(found, len(flows), root)


def _in_order(found: Sequence[Result], count: int, root: Path | None) -> list[Identification]:
    """The results of all processes, in the order of the flows; the rest is in their folders."""
    texts = gather_texts(json.dumps([result.to_dict() for result in found]))
    shares = [[results.from_dict(content) for content in json.loads(text)] for text in texts]
    every = [shares[e % len(shares)][e // len(shares)] for e in range(count)]
    return [
        Identification.of(
            result, None if root is None else in_folder(root / f"{e:03d}", result.friction_law)
        )
        for e, result in enumerate(every)
    ]


S = TypeVar("S")
T = TypeVar("T")


def _side_by_side(work: Callable[[S], T], items: Iterable[S], device: str) -> list[T]:
    """`work` on every item: with a GPU in parallel; on a CPU in turn, as torch uses all cores."""
    with threads(SIDE_BY_SIDE if choose_device(device).type == "cuda" else 1) as pool:
        begun = [pool.submit(work, item) for item in items]
        wait(begun)  # the error of one item leaves the others
        return [item.result() for item in begun]


def _cores() -> int:
    return len(os.sched_getaffinity(0))


def _one_each(name: str, values: Sequence[T] | None, default: T, count: int) -> Sequence[T]:
    if values is not None and len(values) != count:
        raise ConfigError(
            f"{name} must have one value for each of {count} flows, got {len(values)}"
        )
    return [default] * count if values is None else values


def _pose(flows: Sequence[FlowLike], configs: Sequence[Config]) -> list[Case]:
    """The cases; a repeated flow is read once, and without noise its cases share the data."""
    keys = [id(flow) if isinstance(flow, Flow) else str(flow) for flow in flows]
    device = configs[0].device if configs else "cpu"
    distinct = dict(zip(keys, flows, strict=True))
    read = dict(zip(distinct, _side_by_side(sound, distinct.values(), device), strict=True))
    plain: dict[int | str, Config] = {}
    for key, config in zip(keys, configs, strict=True):
        if not config.noise:
            plain.setdefault(key, config)

    def alone(key: int | str, config: Config) -> Case:
        return posed(*read[key], config)

    posed_once = _side_by_side(lambda pair: alone(*pair), plain.items(), device)
    clean = dict(zip(plain, posed_once, strict=True))

    def case(key: int | str, config: Config) -> Case:
        if config.noise:
            return alone(key, config)
        first = clean[key]
        fixed = fixed_values(config, first.facts)
        law = LAWS[config.law]
        member = dataclasses.replace(first.member, seed=config.seed, law=law, fixed=fixed)
        return dataclasses.replace(first, config=config, member=member)

    pairs = zip(keys, configs, strict=True)
    return _side_by_side(lambda pair: case(*pair), pairs, device)
