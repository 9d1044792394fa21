"""From trained networks to the files of a run folder, in a few steps.

`conclude` writes the values and makes the fields. Whatever follows can fail without harm to the
values, and is pending in the file until it is made:

1. `with_assumptions`: the effects of assumptions that the data do not contain, and with them the
   intervals. A law without uncertain assumptions has its intervals at once.
2. `with_law`: what decides which values and intervals are shown (judgement.py).
3. `fields_written`: fields.h5. A single run writes it after its answer, beside step 4; a batch
   writes it before step 1, and then drops the fields to save memory.
4. `simulated`, `with_simulated_pressure`: the pressure that a simulator gives.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

from granpinn import results
from granpinn.identification import (
    assumptions,
    comparison,
    conclusion,
    judgement,
    prediction,
    simulated_fields,
)
from granpinn.identification.assumptions import assumptions_of
from granpinn.identification.case import Case, Model
from granpinn.identification.law_curve import Shear, shear_of
from granpinn.identification.network import FILE, TrainedNetwork, write_network
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
    COMPARISON,
    DETERMINED,
    FIELDS,
    LAW_CURVE,
    PENDING,
    SCORES,
    SIMULATED_PRESSURE,
    attempt,
    awaited,
    having,
    lacking,
    pending,
)
from granpinn.results.findings import SimulatedPressure
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.of_assumptions import Assumption, without_effect


class Concluded(NamedTuple):
    """A result on disk, and what the later steps need.

    Attributes:
        case, model: the member that is shown, and its network.
        place: of this member in the run.
        uncertain: the assumptions whose effect is to come.
        maps: its fields; None if they were not made or not kept.
        shear: the points where grains shear; None without fields.
        of_laws: place in the run of every law of a comparison.
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
    of_laws: dict[str, int]
    folder: Path | None
    keep_fields: bool


def conclude(
    cases: Sequence[Case],
    run: TrainingLoop,
    first: int,
    folder: Path | None = None,
    keep_fields: bool = True,
    simulate: bool = False,
    others: int | None = None,
) -> Concluded:
    """The result of an ensemble, the members of the run from `first` on, written to its folder.

    The values are written before the fields are made. Error bars wait for the effect of uncertain
    assumptions, comparisons wait for the error bars, and fields.h5 waits for `fields_written`.

    Args:
        simulate: whether a simulated pressure will follow if the settings ask for it.
        others: place of the first companion of these cases (comparison.py), by default behind them.

    Raises:
        OutputError: a file cannot be written.
    """
    found, place = conclusion.members_of(cases, run, first)
    case, e = cases[place], first + place
    law = LAWS[case.config.law]
    model = conclusion.model_of(case, run.trainer, e)
    uncertain = () if e in run.trainer.diverged else assumptions_of(case)
    assumed = tuple(without_effect(assumption, PENDING) for assumption in uncertain)
    result = conclusion.result(case, run, e, found, model, assumed)
    result = pending(result, *([ASSUMPTIONS] if uncertain else []), BASELINE)
    if case.config.compare_laws:
        result = pending(result, COMPARISON)
    if folder is not None:
        _write_values(pending(result, FIELDS), folder)
        write_network(TrainedNetwork.of(model, case.flow), folder / FILE)
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
        if folder is not None and keep_fields:
            result = pending(result, FIELDS)
    if folder is not None:
        _write_values(result, folder)
    of_laws = comparison.places(case, e, first + len(cases) if others is None else others)
    return Concluded(result, case, model, e, uncertain, maps, shear, of_laws, folder, keep_fields)


def with_assumptions(concluded: Sequence[Concluded], run: TrainingLoop) -> list[Concluded]:
    """The results with the effects of their assumptions, written to their folders.

    The trainings for all of them are one batch. What is known is on the disk before they begin.
    """
    asked = {c.place: c.uncertain for c in concluded if c.uncertain}
    if not asked:
        return list(concluded)
    concluded = [fields_written(c) for c in concluded]
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


def with_law(concluded: Concluded, run: TrainingLoop) -> Concluded:
    """The result with its final values and intervals (judgement.py), written to its folder."""
    c = concluded
    return _kept(c, judgement.with_law(c.result, c.case, run, c.place, c.shear, c.of_laws))


def fields_written(concluded: Concluded) -> Concluded:
    """`concluded`, with fields.h5 in its folder unless it is there or not asked for.

    Raises:
        OutputError: the file cannot be written.
    """
    return with_fields(concluded) if write_fields_file(concluded) else concluded


def write_fields_file(concluded: Concluded) -> bool:
    """Write fields.h5 unless it is there or not asked for; whether it was written.

    Raises:
        OutputError: the file cannot be written.
    """
    c = concluded
    if c.folder is None or c.maps is None or not awaited(c.result, FIELDS):
        return False
    write_fields(c.maps, c.folder / "fields.h5")
    return True


def with_fields(concluded: Concluded) -> Concluded:
    """The result with fields.h5, which was written, in its folder."""
    return _kept(concluded, having(concluded.result, FIELDS))


class Simulated(NamedTuple):
    """The record of a simulated pressure, and the fields that hold it, if any."""

    record: SimulatedPressure
    maps: Fields | None


def simulated(
    concluded: Concluded, run: TrainingLoop, pool: Executor
) -> Simulated | NotDone | None:
    """The simulated pressure, or why there is none; None if it is not pending.

    The threads of `pool` simulate the frames. Nothing is written.
    """
    case, model = concluded.case, concluded.model
    if not awaited(concluded.result, SIMULATED_PRESSURE):
        return None

    def made() -> Simulated:
        pressures, record = simulated_fields.pressures(case, run, model, pool)
        if not pressures:
            return Simulated(record, None)
        # A batch does not keep the fields of all its members.
        maps = concluded.maps or prediction.predict(case.flow, model)
        maps = simulated_fields.with_simulated_pressure(maps, pressures)
        return Simulated(simulated_fields.compared(case, maps, record), maps)

    return attempt(SIMULATED_PRESSURE, made)


def with_simulated_pressure(concluded: Concluded, found: Simulated | NotDone | None) -> Concluded:
    """`concluded` with what `simulated` gave, written to its folder."""
    if found is None:
        return concluded
    result, maps, folder = concluded.result, None, concluded.folder
    if isinstance(found, NotDone):
        result = lacking(result, found)
    else:
        maps = found.maps
        result = having(result, SIMULATED_PRESSURE, simulated_pressure=found.record)
    if maps is not None:
        result = _scored(result, concluded.case, concluded.model, maps)
    if folder is not None:
        if concluded.keep_fields and maps is not None:
            append_variable(maps, "p_simulated", folder / "fields.h5")
        _write_values(result, folder)
    return concluded._replace(result=result, maps=maps or concluded.maps)


def _scored(result: Result, case: Case, model: Model, maps: Fields) -> Result:
    """The result with its errors against the reference of the flow file."""
    scores = attempt(SCORES, lambda: conclusion.scores(case, model, maps, result.parameters))
    if isinstance(scores, NotDone):
        return lacking(result, scores)
    return having(result, SCORES, **scores._asdict())


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
