"""A fit, with all that checks of it may use, and its result, which grows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from granpinn.fit import prediction, scoring
from granpinn.fit.case import Case
from granpinn.fit.free_curve import with_free_band
from granpinn.fit.network import TrainedNetwork
from granpinn.fit.prediction import Shear, shear_of, with_law
from granpinn.results import Fields, Result, write_fields, write_results
from granpinn.results.record import Record, why_not_done
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.sensitivity import Assumption

FIELDS, ASSUMPTIONS, CURVE = "fields", "assumptions", "curve"  # parts that are no checks


@dataclass
class Context:
    """
    Attributes:
        result: all that is known so far; with a folder it is on the disk.
        case, network: the member that is shown, and what was trained.
        run, place: the training, and the place of this member in it.
        uncertain: the assumptions whose effect enters the error bars.
        of_laws: place in the run of every law of a comparison.
        folder: where the result is written; None: nowhere.
        fields: the predicted fields, where they are kept.
        shear: the points of the fields where grains shear.
    """

    result: Result
    case: Case
    network: TrainedNetwork
    run: TrainingLoop
    place: int
    uncertain: tuple[Assumption, ...] = ()
    of_laws: Mapping[str, int] = field(default_factory=dict)
    folder: Path | None = None
    fields: Fields | None = None
    shear: Shear | None = None

    def keep(self, result: Result) -> None:
        """Take a result that has grown, and write it.

        Raises:
            OutputError: a file cannot be written.
        """
        self.result = result
        if self.folder is not None:
            write_results(result, self.folder / "results.json")

    def attempt(self, part: str, work: Callable[[], Record | None]) -> None:
        """Do what may fail alone; its record, or why it failed, is kept."""
        try:
            record = work()
        except Exception as error:
            self.keep(self.result.without(part, why_not_done(error)))
        else:
            self.keep(self.result.with_record(part, record))

    def predicted(self) -> Fields:
        """The fields; a batch does not keep those of all its members."""
        return self.fields or prediction.predict(self.case.flow, self.network)

    def predict(self) -> None:
        """Predict the fields, compare them with the reference, and write fields.h5 if asked for."""
        fields = self.fields = self.predicted()
        cohesion = self.network.law.cohesion_of(self.result.theta)
        self.shear = shear_of(fields, cohesion)
        flow, given = self.case.flow, self.result.parameters
        at = None if flow.particles is None else self.network.velocity_at(flow.particles)
        errors = scoring.score(flow, fields, given, at)
        self.result = dataclasses.replace(self.result, error_percent=errors)
        if self.folder is not None:
            write_fields(fields, self.folder / "fields.h5")

    def draw_curve(self) -> None:
        """Take the law over the range of I where grains shear, with its band, if fields show it."""
        if self.shear is not None:
            result = with_law(self.result, self.case, self.shear)
            self.result = with_free_band(result, self.case, self.run, self.place)
