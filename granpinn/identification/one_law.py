"""Several flows of one material to one friction law."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from granpinn.checks import comparison_of_laws, shared_law, unknown_I0, wanted
from granpinn.config import Config, ConfigError
from granpinn.data import Flow
from granpinn.estimates.confined import undetermined
from granpinn.fit.case import Case, choose_device, members, pose
from granpinn.fit.one_law import result_of, share_error_bars, with_free_I0
from granpinn.identification import answer
from granpinn.identification.batch import identify_many
from granpinn.identification.identified import Identification, of_flows
from granpinn.identification.start import CHECKS, ERROR_BARS, histories, prepare, start
from granpinn.output import owned
from granpinn.results import Result
from granpinn.results.record import make
from granpinn.simulation.threads import threads
from granpinn.training.guard import NonFiniteError
from granpinn.training.history import Row
from granpinn.training.parallel import processes
from granpinn.training.progress import Progress


def identify_one_law(
    flows: Sequence[Flow | str | os.PathLike[str]],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    on_step: Callable[[Row], Any] | None,
    on_values: Callable[[Result], Any] | None,
    begin: float,
) -> Identification:
    """The law that all flows have, trained as one batch; arguments and errors as of `identify`.

    Network k of every flow is in one group: they share theta (training/objective.py). The
    subfolders 000, 001, ... get the files that `identify` writes, one subfolder for each flow.

    Raises:
        ConfigError: the settings ask for a check of a single flow, or a flow cannot take part.
    """
    checks, together = wanted(config), processes(choose_device(config.device))
    single = (comparison_of_laws.CHECK, unknown_I0.CHECK, *(c for c in checks if c.trains))
    own = [check for check in checks if check not in single]
    for check in checks:
        if check in single and check is not shared_law.CHECK and check.asked(config):
            raise ConfigError(
                f"{check.name.replace('_', ' ')} is a check of one flow, got {len(flows)} flows "
                "with one law: leave it out, or train on one flow"
            )
    cases, of_I0 = with_free_I0([_posed(flow, config) for flow in flows])
    K = config.members
    every = [member for case in cases for member in _in_groups(case)]
    with (
        owned(None if together.rank else folder),
        threads(len(os.sched_getaffinity(0))) as pool,
        ExitStack() as at_end,
    ):
        parts: list[Path | None] = [None] * len(cases)
        if folder is not None:
            parts = [folder / f"{f:03d}" for f in range(len(cases))]
        if together.rank > 0:
            progress = None
        elif folder is not None:
            prepare(folder, config)
            for case, part in zip(cases, parts, strict=True):
                assert part is not None
                prepare(part, dataclasses.replace(case.config, resume=config.resume), K)
        together.barrier()
        places = [place for part in parts for place in histories(part, K)]
        run = start(every, config, folder, progress, begin, places, together, own, shown=len(cases))
        run.on_step = on_step
        if of_I0 is not None:
            run.progress.message(of_I0)
        at_end.callback(run.progress.stop)
        run.train()
        if len(run.trainer.diverged) == len(every):
            raise NonFiniteError(run.trainer.diverged[0])
        writes = together.rank == 0
        contexts = [
            answer.valued(
                flow,
                every[f * K : (f + 1) * K],
                run,
                f * K,
                own,
                parts[f] if writes else None,
            )
            for f, flow in enumerate(flows)
        ]
        run.progress.stage(ERROR_BARS)
        if writes:
            for context in contexts:
                answer.with_fields(context)
                context.fields = None  # those of all flows would not fit into memory
            answer.with_intervals(contexts, run)
            share_error_bars(contexts)
            for context in contexts:
                answer.with_curve(context)
        root = dataclasses.replace(
            contexts[0],
            result=result_of(contexts, config),
            folder=folder if writes else None,
            pool=pool,
            identify_many=identify_many,
            shown=on_values,
            flows=contexts,
        )
        root.keep(root.result)
        run.progress.stage(CHECKS)
        if writes:
            for context in contexts:
                context.pool = pool
                make(context, own)
            root.keep(result_of(contexts, config))
        make(root, [check for check in checks if check is shared_law.CHECK])
        each = tuple(answer.kept(context) for context in contexts)
        return Identification.of(root.result, of_flows(lambda: each, folder))


def _posed(flow: Flow | str | os.PathLike[str], config: Config) -> Case:
    """The case of a flow that can take part; ConfigError for others."""
    path = None if isinstance(flow, Flow) else os.fspath(flow)
    case = pose(flow, dataclasses.replace(config, flow=path, further_flows=()))
    if (reason := undetermined(case.seen, config.level)) is not None:
        raise ConfigError(
            f"{path or 'a flow in memory'} determines no friction coefficient: {reason}; leave "
            "this flow out"
        )
    return case


def _in_groups(case: Case) -> list[Case]:
    """The ensemble of a case; its member k is in group k."""
    return [
        dataclasses.replace(one, member=dataclasses.replace(one.member, group=k))
        for k, one in enumerate(members(case))
    ]
