"""The simulated pressure beside the predicted one: how much the motion leaves open.

The simulation starts from the predicted velocity (second_opinion/simulated_pressure.py).
"""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.data.symmetry import axes_of
from granpinn.fit import prediction, scoring
from granpinn.fit.case import Case, Model
from granpinn.fit.context import Context
from granpinn.results import Fields, append_variable
from granpinn.results.record import Check, Record
from granpinn.second_opinion.simulated_pressure import Velocity, at_frames

EACH_FRAME = 0.5  # seconds of a frame on one idle core; none begins later before a time limit
SAY_EVERY = 10.0  # seconds


@dataclass(frozen=True)
class SimulatedPressure(Record):
    """The simulated pressure at some frames.

    Attributes:
        objection: the reason for its absence; all numbers are then None.
        cells: across the box.
        frames: indices of the frames that have a simulated pressure.
        failed: frames at which a solve did not converge.
        late: frames that the time limit left out.
        seconds: for all frames.
        flowing_percent, stagnant_percent: rms difference of the predicted and the simulated
            pressure over the rms of the simulated one, by zones (fit/scoring.py); None for an
            empty zone.
    """

    title = "Simulated pressure"
    notes = (
        "The motion does not determine the pressure where grains do not shear: values in resting "
        "grains are a plausible continuation and no more. The simulated pressure is of a "
        "simulation that starts from the predicted velocity, with the identified law. In resting "
        "grains it is of a material that creeps at the largest viscosity between the simulator's "
        "floor and plane of symmetry. The difference is what the motion leaves open."
    )

    objection: str | None
    cells: int | None = None
    frames: tuple[int, ...] = ()
    failed: int = 0
    late: int = 0
    seconds: float | None = None
    flowing_percent: float | None = None
    stagnant_percent: float | None = None

    @property
    def words(self) -> str:
        if self.objection is not None:
            return f"no simulated pressure: {self.objection}"
        parts = [f"{self.failed} did not converge"] if self.failed else []
        parts += [f"{self.late} had no time left"] if self.late else []
        left_out = f" (left out: {', '.join(parts)})" if parts else ""
        if not self.frames:
            return f"no simulated pressure{left_out}"
        zones = {"flowing": self.flowing_percent, "resting": self.stagnant_percent}
        parts = [f"{p:.1f} % in {zone} grains" for zone, p in zones.items() if p is not None]
        return (
            f"simulated pressure at {len(self.frames)} times: the predicted pressure differs by "
            f"{' and '.join(parts) or 'an unknown amount'}{left_out}"
        )

    def figures(self) -> dict[str, tuple[str, Callable[[Any], Any]]]:
        if not self.frames:
            return {}
        from granpinn.figures.album import fields_of
        from granpinn.figures.maps import simulated_pressure

        drawing = lambda source: simulated_pressure(fields_of(source), source.frame)  # noqa: E731
        return {"pressure_simulated": (self.title, drawing)}


def make(context: Context) -> SimulatedPressure | None:
    """The record; `p_simulated` is a further field, and the errors of fields count it."""
    case, model = context.case, context.model
    settings = case.config.simulated_pressure
    if not settings.frames or context.shear is None:  # no fields either
        return None
    begin = time.monotonic()
    found = at_frames(
        case.flow,
        model.law,
        model.law.to_physical(model.theta.tolist(), model.scales.pressure),
        velocity_of(case.flow, model),
        settings.frames,
        settings.cells,
        wall_friction=case.config.side_walls.friction,
        pool=context.pool,
        deadline=_deadline(context),
        listener=_progress(context),
    )
    if isinstance(found, str):
        return SimulatedPressure(found)
    seconds = time.monotonic() - begin
    record = SimulatedPressure(
        None, found.cells, tuple(found.at), found.failed, found.late, seconds
    )
    if not found.at:
        return record
    fields = with_simulated_pressure(context.predicted(), found.at)
    if context.fields is not None:
        context.fields = fields
    context.score(fields)
    if context.keep_fields and context.folder is not None:
        append_variable(fields, "p_simulated", context.folder / "fields.h5")
    flowing, stagnant = difference(case, fields)
    return dataclasses.replace(record, flowing_percent=flowing, stagnant_percent=stagnant)


def _deadline(context: Context) -> float | None:
    """The time after which no frame is begun."""
    limit = context.run.limit
    return None if limit is None else limit.until - EACH_FRAME


def _progress(context: Context) -> Callable[[int, int], None]:
    said = time.monotonic()

    def say(done: int, frames: int) -> None:
        nonlocal said
        if time.monotonic() - said > SAY_EVERY:
            said = time.monotonic()
            context.run.progress.message(f"simulating the pressure {done}/{frames}")

    return say


def velocity_of(flow: Flow, model: Model) -> Velocity:
    """The predicted velocity at any point, in the units and axes of a flow."""
    axes = axes_of(flow)
    one_at_a_time = threading.Lock()  # torch uses all cores for one evaluation

    def velocity(x: Float64, y: Float64, t: float) -> tuple[Float64, Float64]:
        points = model.scales.points_to_dimensionless(x, y, t)
        with one_at_a_time:
            u, v = prediction.velocity(points, axes, model)
        return u, v

    return velocity


def with_simulated_pressure(fields: Fields, pressures: dict[int, Float64]) -> Fields:
    """The fields with a simulated pressure [Y, X] by frame; `p_simulated` is NaN at the others."""
    frame, place = np.divmod(fields.index, fields.y.size * fields.x.size)
    values = np.full(len(fields.index), np.nan, np.float32)
    for k, p in pressures.items():
        values[frame == k] = p.ravel()[place[frame == k]]
    return dataclasses.replace(fields, values=fields.values | {"p_simulated": values})


def difference(case: Case, fields: Fields) -> tuple[float | None, float | None]:
    """rms difference of predicted and simulated pressure over the rms of the simulated one, in %.

    One value for the flowing points and one for the stagnant points; None for an empty zone.
    """
    p, simulated = fields.values["p"], fields.values["p_simulated"]
    known = np.isfinite(simulated)
    split = scoring.zones_of(case.flow, fields, lambda: case.shared.strain_rate)
    flowing, stagnant = (
        relative_l2(p[known & zone], simulated[known & zone])
        for zone in (split.flowing, split.stagnant)
    )
    return flowing, stagnant


CHECK = Check("simulated_pressure", SimulatedPressure, make, seconds=7.0)
