"""Cases to answers: all are trained side by side, then each gets its values and its checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import torch

from granpinn.checks import momentum_balance
from granpinn.checks.comparison_of_laws import companions
from granpinn.config import Config
from granpinn.fit.case import Case, members
from granpinn.fit.context import Context
from granpinn.identification import answer
from granpinn.identification.identified import Identification
from granpinn.identification.start import CHECKS, ERROR_BARS, start
from granpinn.results import Result
from granpinn.results.record import Check
from granpinn.simulation.threads import beside_gpu, threads
from granpinn.training.guard import NonFiniteError
from granpinn.training.progress import Progress


def run(
    cases: Sequence[Case],
    config: Config,
    checks: Sequence[Check],
    folder: Path | None,
    parts: Sequence[Path | None],
    progress: Progress | None,
    begin: float,
    device: torch.device,
    *,
    alone: bool = False,
    on_values: Callable[[Result], Any] | None = None,
) -> list[Identification]:
    """Train the ensembles of cases as one batch, and make the results and their checks.

    Args:
        folder: of the checkpoints.
        parts: where the results of each case are written.
        alone: there is one case, whose failure raises NonFiniteError; others leave a `failure`.
        on_values: as in `identify`.

    Raises:
        NonFiniteError: the one case diverged.
    """
    K, on_gpu = config.members, device.type == "cuda"
    every = [member for case in cases for member in members(case)]
    others = [companions(case) for case in cases]
    behind = [len(every) + sum(map(len, others[:e])) for e in range(len(cases))]
    everyone = [*every, *(other for own in others for other in own)]
    places = [place for part in parts for place in (part, *[None] * (K - 1))]
    places += [None] * (len(everyone) - len(places))
    with ExitStack() as at_end:
        loop = start(
            everyone,
            config,
            folder,
            progress,
            begin,
            device,
            None if alone and len(everyone) == 1 else places,
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
            context = answer.valued(
                every[e * K : (e + 1) * K],
                loop,
                e * K,
                checks,
                parts[e],
                behind[e],
            )
            answer.with_fields(context)
            if not alone:
                context.fields = None  # those of all cases would not fit into memory
            return context

        loop.progress.stage(ERROR_BARS)
        contexts = beside_gpu(valued, range(len(cases)), on_gpu)
        answer.with_intervals(contexts, loop)
        loop.progress.stage(CHECKS)

        def finished(context: Context) -> Identification:
            answer.with_curve(context, on_values)
            for check in checks:
                context.take(check)
            return answer.kept(context)

        return beside_gpu(finished, contexts, on_gpu)
