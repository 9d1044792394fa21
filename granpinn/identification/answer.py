"""From trained networks to the answer: the values on the disk, fields, intervals and curve.

What follows the values can fail without harm to them. In the file it is "not done" until then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from granpinn.checks.comparison_of_laws import places
from granpinn.fit import assumptions, ensemble, prediction
from granpinn.fit.case import Case
from granpinn.fit.context import Context
from granpinn.fit.network import FILE, TrainedNetwork, write_network
from granpinn.identification.identified import Identification
from granpinn.output import OutputError
from granpinn.results import Result
from granpinn.results.attempt import PENDING, NotDone, attempt
from granpinn.results.record import NONE, Check
from granpinn.training.history import History
from granpinn.training.loop import TrainingLoop

FIELDS, ASSUMPTIONS, CURVE = "fields", "assumptions", "curve"
LEFT_OUT = "--checks none leaves it out"


def valued(
    cases: Sequence[Case],
    run: TrainingLoop,
    first: int,
    checks: Sequence[Check],
    folder: Path | None,
    others: int,
) -> Context:
    """The fit of an ensemble, the members of the run from `first` on, with its values on the disk.

    Args:
        checks: those that will follow; they are pending until then.
        others: place of the first companion of these cases (checks/comparison_of_laws.py).

    Raises:
        OutputError: a file cannot be written.
    """
    members, place = ensemble.members_of(cases, run, first)
    case, e = cases[place], first + place
    model = ensemble.model_of(case, run.trainer, e)
    uncertain = () if e in run.trainer.diverged else assumptions.assumptions_of(case)
    left_out = case.config.checks == NONE
    why = LEFT_OUT if left_out else PENDING
    unknown = tuple(a.without_effect(why) for a in uncertain)
    result = ensemble.result(case, run, e, members, model, unknown)
    uncertain = () if left_out else uncertain
    parts = [FIELDS, CURVE, *(check.name for check in checks)]
    for part in [*parts, ASSUMPTIONS] if uncertain else parts:
        result = result.without(part, PENDING)
    context = Context(
        result,
        case,
        model,
        run,
        e,
        uncertain,
        places(case, e, others),
        folder,
    )
    context.keep(result)
    if folder is not None:
        write_network(TrainedNetwork.of(model, case.flow), folder / FILE)
        if place > 0:  # until now the history is that of the first member
            shown = History(folder / "history.csv", case.member.law)
            shown.begin(run.histories[e].rows)
            shown.close()
    return context


def with_fields(context: Context) -> None:
    """Predict the fields of a fit, and write them."""
    context.attempt(FIELDS, context.predict)
    context.keep(context.result)


def with_intervals(contexts: Sequence[Context], run: TrainingLoop) -> None:
    """Find the effects of uncertain assumptions, and with them the intervals, as one batch."""
    asked = {c.place: c.uncertain for c in contexts if c.uncertain}
    found = attempt(lambda: assumptions.trained(asked, run)) if asked else {}
    for context in contexts:
        if not context.uncertain:
            continue
        if isinstance(found, NotDone):
            why = found.why
            effects = tuple(a.without_effect(why) for a in context.uncertain)
            result = context.result.without(ASSUMPTIONS, why)
        else:
            effects = found[context.place]
            result = context.result.with_record(ASSUMPTIONS, None)
        context.keep(ensemble.with_assumptions(result, context.case, effects))


def with_curve(context: Context, shown: Callable[[Result], None] | None) -> None:
    """Find the law over the range of I that the data have; the answer is known then.

    Args:
        shown: called with the result from now on whenever it has grown.
    """
    if context.shear is not None:
        context.attempt(CURVE, context.draw_curve)
    else:
        context.result = context.result.with_record(CURVE, None)
    context.shown = shown
    context.keep(context.result)


def kept(context: Context) -> Identification:
    """The result with its network, fields and history: those of its folder, else in memory."""
    case, model = context.case, context.model
    known: dict[str, Any] = {} if context.fields is None else {"grid": context.fields}
    if context.folder is not None:
        return Identification.of(context.result, context.folder, **known)
    known["network"] = TrainedNetwork.of(model, case.flow)
    known["history"] = context.run.histories[context.place].columns
    predict = partial(prediction.predict, case.flow, model)
    return Identification.of(context.result, predict=predict, **known)


def require_kept(folder: Path) -> None:
    """Raise OutputError if files of a finished run are gone: somebody removed its folder."""
    missing = [name for name in ("config.toml", "results.json") if not (folder / name).exists()]
    if missing:
        raise OutputError(
            f"{folder} was removed during the run (it lacks {' and '.join(missing)}): start again "
            f"with an --out that stays"
        )
