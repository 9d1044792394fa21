"""From trained networks to the files of a run folder, in four steps.

`conclude` writes the values and the fields. Whatever follows can fail without harm to them, and is
pending in the file until it is made:

1. `with_assumptions`: the effects of assumptions that the data do not contain, and with them the
   intervals. A law without uncertain assumptions has its intervals at once.
2. `with_comparisons`: what needs the final intervals. These are the momentum balance beside the
   law, the parameters that the range of I determines, the curve, and the law on parts of the data.
3. `with_simulated_pressure`: the pressure that a simulator gives.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from granpinn import results
from granpinn.arrays import Floats
from granpinn.data.surface_sd import SOLVER
from granpinn.identification import (
    assumptions,
    balance,
    conclusion,
    prediction,
    simulated_fields,
)
from granpinn.identification.assumptions import assumptions_of
from granpinn.identification.case import Case, Model
from granpinn.identification.law_curve import Shear, shear_of, with_law_curve
from granpinn.inspection.confined import undetermined
from granpinn.output import OutputError, replacing
from granpinn.physics.laws import LAWS
from granpinn.results import (
    Fields,
    NotDone,
    Result,
    append_variable,
    write_csv,
    write_fields,
)
from granpinn.results.attempt import (
    ASSUMPTIONS,
    BASELINE,
    DETERMINED,
    FIELDS,
    LAW_CURVE,
    PARTS,
    PENDING,
    SCORES,
    SIMULATED_PRESSURE,
    attempt,
    having,
    lacking,
    pending,
)
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty import of_kind, of_parts
from granpinn.uncertainty.determined import applied, determined, range_of, unfixed
from granpinn.uncertainty.of_assumptions import Assumption, without_effect


class Concluded(NamedTuple):
    """A result on disk, and what the later steps need.

    Attributes:
        case, model: the member that is shown, and its network.
        place: of this member in the run.
        uncertain: the assumptions whose effect is to come.
        maps: its fields; None if they were not made or not kept.
        shear: the points where grains shear; None without fields.
        folder: where the result is written; None: nowhere.
        keep_fields: whether fields.h5 is written.
    """

    result: Result
    case: Case
    model: Model
    place: int
    uncertain: tuple[Assumption, ...]
    maps: Fields | None
    shear: Shear | NotDone | None
    folder: Path | None
    keep_fields: bool


def conclude(
    cases: Sequence[Case],
    run: TrainingLoop,
    first: int,
    folder: Path | None = None,
    keep_fields: bool = True,
    simulate: bool = False,
) -> Concluded:
    """The result of an ensemble, the members of the run from `first` on, written to its folder.

    The values are written before the fields are made. Error bars wait for the effect of uncertain
    assumptions, and comparisons wait for the error bars.

    Args:
        simulate: whether a simulated pressure will follow if the settings ask for it.

    Raises:
        OutputError: a file cannot be written.
    """
    found, place = conclusion.members_of(cases, run, first)
    case, e = cases[place], first + place
    law = LAWS[case.config.law]
    model = Model(case.member.problem, *run.trainer.solution(e), case.scales, law)
    uncertain = () if e in run.trainer.diverged else assumptions_of(case)
    assumed = tuple(without_effect(assumption, PENDING) for assumption in uncertain)
    result = conclusion.result(case, run, e, found, model, assumed)
    result = pending(result, *([ASSUMPTIONS] if uncertain else []), BASELINE)
    if _has_parts(case, run, e):
        result = pending(result, PARTS)
    if folder is not None:
        _write_values(pending(result, FIELDS), folder)
        if len(cases) > 1:
            shown = parts_of(folder, len(cases))[place]
            with replacing(folder / "history.csv") as temporary:
                shutil.copyfile(shown / "history.csv", temporary)
    predicted = attempt(FIELDS, lambda: prediction.predict(case.flow, model))
    maps = shear = None
    if isinstance(predicted, NotDone):
        result = lacking(result, predicted)
    else:
        maps = predicted
        result = pending(_scored(result, case, model, maps), DETERMINED, LAW_CURVE)
        cohesion = law.cohesion_of(result.theta)
        shear = attempt(DETERMINED, lambda: shear_of(predicted, cohesion))
        if simulate and case.config.simulated_pressure.frames:
            result = pending(result, SIMULATED_PRESSURE)
    if folder is not None:
        _write_values(result, folder)
        if keep_fields and maps is not None:
            write_fields(maps, folder / "fields.h5")
    return Concluded(result, case, model, e, uncertain, maps, shear, folder, keep_fields)


def with_assumptions(concluded: Sequence[Concluded], run: TrainingLoop) -> list[Concluded]:
    """The results with the effects of their assumptions, written to their folders.

    The trainings for all of them are one batch.
    """
    asked = {c.place: c.uncertain for c in concluded if c.uncertain}
    if not asked:
        return list(concluded)
    found = attempt(ASSUMPTIONS, lambda: assumptions.trained(asked, run))

    def made(c: Concluded) -> Concluded:
        if not c.uncertain:
            return c
        if isinstance(found, NotDone):
            assumed = tuple(without_effect(assumption, found.why) for assumption in c.uncertain)
            result = lacking(c.result, found)
        else:
            assumed, result = found[c.place], having(c.result, ASSUMPTIONS)
        return _kept(c, conclusion.with_assumptions(result, c.case, assumed))

    return [made(c) for c in concluded]


def with_comparisons(concluded: Concluded, run: TrainingLoop) -> Concluded:
    """The result with the momentum balance, what its range of I determines, its curve and its law
    on parts of the data, written to its folder.
    """
    case, place, shear = concluded.case, concluded.place, concluded.shear
    result = _with_baseline(concluded.result, case)
    if isinstance(shear, NotDone):
        result = having(lacking(result, shear), LAW_CURVE)
    elif shear is not None:
        result = with_law_curve(_with_range(result, case, shear.I), shear)
    concluded = _kept(concluded, result)
    if not _has_parts(case, run, place):
        return concluded

    def on_parts() -> Result:
        level, kind = case.config.level, _kind(result, case)
        return of_parts.judged(result, run.trainer.laws_on_parts(place), level, kind)

    made = attempt(PARTS, on_parts)
    made = lacking(result, made) if isinstance(made, NotDone) else having(made, PARTS)
    return _kept(concluded, made)


def with_simulated_pressure(concluded: Concluded, run: TrainingLoop, pool: Executor) -> Result:
    """The result with the simulated pressure if it is pending, written to its folder.

    The threads of `pool` simulate the frames.
    """
    result, case, model = concluded.result, concluded.case, concluded.model
    if all(part.what != SIMULATED_PRESSURE for part in result.not_done):
        return result

    def simulated() -> tuple[Result, Fields | None]:
        pressures, record = simulated_fields.pressures(case, run, model, pool)
        maps = None
        if pressures:  # a batch does not keep the fields of all its members
            maps = concluded.maps or prediction.predict(case.flow, model)
            maps = simulated_fields.with_simulated_pressure(maps, pressures)
            record = simulated_fields.compared(case.flow, maps, record)
        made = having(result, SIMULATED_PRESSURE, simulated_pressure=record)
        return made if maps is None else _scored(made, case, model, maps), maps

    found = attempt(SIMULATED_PRESSURE, simulated)
    result, maps = (lacking(result, found), None) if isinstance(found, NotDone) else found
    if (folder := concluded.folder) is not None:
        if concluded.keep_fields and maps is not None:
            append_variable(maps, "p_simulated", folder / "fields.h5")
        _write_values(result, folder)
    return result


def _scored(result: Result, case: Case, model: Model, maps: Fields) -> Result:
    """The result with its errors against the reference of the flow file."""
    scores = attempt(SCORES, lambda: conclusion.scores(case, model, maps, result.parameters))
    if isinstance(scores, NotDone):
        return lacking(result, scores)
    return having(result, SCORES, **scores._asdict())


def _with_range(result: Result, case: Case, number: Floats) -> Result:
    """The result without the parameters that its range of I, or its walls, do not determine.

    Kinds of flows with a known model error get their error bars first.

    Args:
        number: I of the grains that shear [n]; the loss weights every vector alike.
    """

    def of_shear() -> Result:
        weight, reason = np.ones(number.shape), undetermined(case.seen, case.config.level)
        if reason is not None:
            return applied(result, unfixed(result, number, weight, reason))
        made = _with_model_error(result, case, number)
        found = determined(made, number, weight)
        return made if found is None else applied(made, found)

    made = attempt(DETERMINED, of_shear)
    return lacking(result, made) if isinstance(made, NotDone) else having(made, DETERMINED)


def _with_model_error(result: Result, case: Case, number: Floats) -> Result:
    """The result with the error bars of its kind of flow; `number`: I of the grains that shear."""
    if (I0 := result.parameters.get("I0")) is None:
        return result
    shear = range_of(number, np.ones(number.shape), I0.value)
    if shear is None:
        return result
    return of_kind.with_model_error(result, case.config, _kind(result, case), shear)


def _kind(result: Result, case: Case) -> str | None:
    carried = result.baseline is not None and result.baseline.carried
    return of_kind.kind_of(result.data.symmetries, carried, case.flow.stated(SOLVER) is not None)


def _has_parts(case: Case, run: TrainingLoop, place: int) -> bool:
    """Whether there is a law to solve for on parts of the data."""
    return place in run.trainer.solved and undetermined(case.seen, case.config.level) is None


def _with_baseline(result: Result, case: Case) -> Result:
    """The result with the momentum balance beside it."""
    found = attempt(BASELINE, lambda: balance.beside(case.balance, result))
    if isinstance(found, NotDone):
        return lacking(result, found)
    return having(balance.judged(result, found), BASELINE)


def _kept(concluded: Concluded, result: Result) -> Concluded:
    """`concluded` with another result, written to its folder."""
    if concluded.folder is not None:
        _write_values(result, concluded.folder)
    return concluded._replace(result=result)


def _write_values(result: Result, folder: Path) -> None:
    results.write_results(result, folder / "results.json")
    write_csv(result, folder / "results.csv")


def parts_of(folder: Path, count: int) -> list[Path]:
    """The folders of the histories of `count` members of a run."""
    return [folder] if count == 1 else [folder / "members" / f"{k:02d}" for k in range(count)]


def require_kept(folder: Path) -> None:
    """Raise OutputError if files of a finished run are gone: somebody removed its folder."""
    missing = [name for name in ("config.toml", "results.json") if not (folder / name).exists()]
    if missing:
        raise OutputError(
            f"{folder} was removed during the run (it lacks {' and '.join(missing)}): start again "
            f"with an --out that stays"
        )
