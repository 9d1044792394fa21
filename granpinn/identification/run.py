"""Flows to answers: all are trained side by side, then each gets its values and its checks."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from granpinn.checks import momentum_balance, wanted
from granpinn.checks.comparison_of_laws import companions, places
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.fit import assumptions, ensemble, prediction
from granpinn.fit.case import Case, fixed_values, members, posed, sound
from granpinn.fit.context import ASSUMPTIONS, CURVE, FIELDS, Context
from granpinn.fit.network_file import FILE, write_network
from granpinn.identification.identified import Identification
from granpinn.identification.start import CHECKS, ERROR_BARS, prepare, start
from granpinn.identification.threads import beside_gpu, threads
from granpinn.kernels.builds import choose_device
from granpinn.output import owned
from granpinn.physics.laws import LAWS
from granpinn.progress import Progress
from granpinn.results.record import NONE, PENDING, Check, why_not_done
from granpinn.training.guard import NonFiniteError
from granpinn.training.history import History
from granpinn.training.loop import TrainingLoop

FlowLike = Flow | str | os.PathLike[str]
LEFT_OUT = "--checks none leaves it out"


def run(
    flows: Sequence[FlowLike],
    configs: Sequence[Config],
    config: Config,
    folder: Path | None,
    progress: Progress | None,
    begin: float,
    *,
    alone: bool = False,
) -> list[Identification]:
    """Train flows, each with its own settings, as one batch; make the results and their checks.

    Args:
        config: the settings that all share.
        folder: of the checkpoints; its subfolders 000, 001, ... get the results of each flow.
        begin: where a time limit begins.
        alone: there is one flow, whose results are in `folder`; others leave a `failure`.

    Raises:
        NonFiniteError: the one flow diverged.
    """
    checks, device = wanted(config), choose_device(config.device)
    on_gpu = device.type == "cuda"
    cases = _pose(flows, configs, on_gpu)
    K = config.members
    every = [member for case in cases for member in members(case)]
    others = [companions(case) for case in cases]
    behind = [len(every) + sum(map(len, others[:e])) for e in range(len(cases))]
    everyone = [*every, *(other for own in others for other in own)]
    with owned(folder), ExitStack() as at_end:
        parts: list[Path | None] = [None] * len(cases)
        if folder is not None:
            prepare(folder, config)
            parts = [folder]
        if folder is not None and not alone:
            parts = [prepare(folder / f"{e:03d}", case.config) for e, case in enumerate(cases)]
        homes = [place for part in parts for place in (part, *[None] * (K - 1))]
        homes += [None] * (len(everyone) - len(homes))
        loop = start(
            everyone,
            config,
            folder,
            progress,
            begin,
            device,
            None if alone and len(everyone) == 1 else homes,
            checks,
            len(cases),
        )
        at_end.callback(loop.progress.stop)
        with threads(1) as beside:
            ahead = []
            if on_gpu:  # the cores of the CPU are idle
                ahead = [beside.submit(momentum_balance.prepare, case) for case in cases]
            loop.train()
            for later in ahead:  # what has not begun is made by all cores, in its place
                later.cancel()
        if alone and all(e in loop.trainer.diverged for e in range(K)):
            raise NonFiniteError(loop.trainer.diverged[0])

        def valued(e: int) -> Context:
            own = slice(e * K, (e + 1) * K)
            context = with_values(every[own], loop, e * K, checks, parts[e], behind[e])
            context.attempt(FIELDS, context.predict)
            if not alone:
                context.fields = None  # those of all cases would not fit into memory
            return context

        loop.progress.stage(ERROR_BARS)
        contexts = beside_gpu(valued, range(len(cases)), on_gpu)
        with_intervals(contexts, loop)
        loop.progress.stage(CHECKS)

        def finished(context: Context) -> Identification:
            context.attempt(CURVE, context.draw_curve)
            for check in checks:
                context.attempt(check.name, partial(check.make, context))
            return kept(context)

        return beside_gpu(finished, contexts, on_gpu)


def _pose(flows: Sequence[FlowLike], configs: Sequence[Config], on_gpu: bool) -> list[Case]:
    """The cases; a repeated flow is read once, and without noise its cases share the data."""
    keys = [id(flow) if isinstance(flow, Flow) else str(flow) for flow in flows]
    distinct = dict(zip(keys, flows, strict=True))
    read = dict(zip(distinct, beside_gpu(sound, list(distinct.values()), on_gpu), strict=True))
    plain: dict[int | str, Config] = {}
    for key, config in zip(keys, configs, strict=True):
        if not config.noise:
            plain.setdefault(key, config)

    def alone(key: int | str, config: Config) -> Case:
        return posed(*read[key], config)

    posed_once = beside_gpu(lambda pair: alone(*pair), list(plain.items()), on_gpu)
    clean = dict(zip(plain, posed_once, strict=True))

    def case(key: int | str, config: Config) -> Case:
        if config.noise:
            return alone(key, config)
        first = clean[key]
        fixed = fixed_values(config, first.facts)
        law = LAWS[config.law]
        member = dataclasses.replace(first.member, seed=config.seed, law=law, fixed=fixed)
        return dataclasses.replace(first, config=config, member=member)

    pairs = list(zip(keys, configs, strict=True))
    return beside_gpu(lambda pair: case(*pair), pairs, on_gpu)


def with_values(
    cases: Sequence[Case],
    run: TrainingLoop,
    first: int,
    checks: Sequence[Check],
    folder: Path | None,
    others: int,
) -> Context:
    """The fit of an ensemble, the members of the run from `first` on, with its values on the disk.

    What follows the values can fail without harm to them. In the file it is "not done" until then.

    Args:
        others: place of the first companion of these cases (checks/comparison_of_laws.py).
    """
    members, place = ensemble.members_of(cases, run, first)
    case, e = cases[place], first + place
    network = ensemble.network_of(case, run.trainer, e)
    uncertain = () if e in run.trainer.diverged else assumptions.assumptions_of(case)
    left_out = case.config.checks == NONE
    unknown = tuple(a.without_effect(LEFT_OUT if left_out else PENDING) for a in uncertain)
    uncertain = () if left_out else uncertain
    later = [
        FIELDS,
        CURVE,
        *(check.name for check in checks),
        *([ASSUMPTIONS] if uncertain else []),
    ]
    result = ensemble.result(case, run, e, members, network, unknown)
    result = dataclasses.replace(result, not_done=dict.fromkeys(later, PENDING))
    of_laws = places(case, e, others)
    context = Context(result, case, network, run, e, uncertain, of_laws, folder)
    context.keep(result)
    if folder is not None:
        write_network(network, folder / FILE)
        if place > 0:  # until now the history is that of the first member
            shown = History(folder / "history.csv", case.member.law)
            shown.begin(run.histories[e].rows)
            shown.close()
    return context


def with_intervals(contexts: Sequence[Context], run: TrainingLoop) -> None:
    """Find the effects of uncertain assumptions, and with them the intervals, as one batch."""
    asked = {c.place: c.uncertain for c in contexts if c.uncertain}
    found, why = {}, ""
    try:
        found = assumptions.trained(asked, run) if asked else {}
    except Exception as error:
        why = why_not_done(error)
    for context in contexts:
        if not context.uncertain:
            continue
        if why:
            effects = tuple(a.without_effect(why) for a in context.uncertain)
            result = context.result.without(ASSUMPTIONS, why)
        else:
            effects = found[context.place]
            result = context.result.with_record(ASSUMPTIONS, None)
        context.keep(ensemble.with_assumptions(result, context.case, effects))


def kept(context: Context) -> Identification:
    """The result with its network, fields and history: those of its folder, else in memory."""
    known: dict[str, Any] = {} if context.fields is None else {"grid": context.fields}
    if context.folder is not None:
        return Identification.of(context.result, context.folder, **known)
    known["network"] = context.network.apart()
    known["history"] = context.run.histories[context.place].columns
    predict = partial(prediction.predict, context.case.flow, context.network)
    return Identification.of(context.result, predict=predict, **known)
