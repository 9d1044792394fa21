"""The fields of a trained network with the simulated pressure at some frames."""

from __future__ import annotations

import os
import threading
import time
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.data.symmetry import axes_of
from granpinn.identification import prediction, scoring
from granpinn.identification.case import Case, Model
from granpinn.results.fields import Fields
from granpinn.results.findings import SimulatedPressure
from granpinn.second_opinion import simulated_pressure
from granpinn.training.loop import TrainingLoop

AFTER_TRAINING = 30.0  # seconds of a time limit that are kept for fields, figures and report
EACH_FRAME = 2.0  # additional seconds for every simulated frame, divided by the number of cores
AFTER_TRAINING_PART = 0.25  # largest part of a time limit that is kept
SIMULATION_PART = 0.5  # part of the kept time in which frames may begin
SAY_EVERY = 10.0  # seconds


def kept_after_training(config: Config, members: int) -> float:
    """Seconds that a training of `members` networks keeps of its time limit; 0 without a limit.

    One of `config.members` networks is shown, and only this one has a simulated pressure.
    """
    frames = config.simulated_pressure.frames * max(1, members // config.members)
    wanted = AFTER_TRAINING + EACH_FRAME * frames / len(os.sched_getaffinity(0))
    return min(wanted, AFTER_TRAINING_PART * (config.max_time or 0.0))


def pressures(
    case: Case, run: TrainingLoop, model: Model, pool: Executor
) -> tuple[dict[int, Float64], SimulatedPressure]:
    """The simulated pressure [Y, X] by frame, and its record without a comparison."""
    said = time.monotonic()

    def say(done: int, frames: int) -> None:
        nonlocal said
        if time.monotonic() - said > SAY_EVERY:
            said = time.monotonic()
            run.progress.message(f"simulating the pressure {done}/{frames}")

    deadline = None
    if run.deadline is not None:
        kept = kept_after_training(case.config, len(run.trainer.params))
        deadline = run.deadline + run.later + SIMULATION_PART * kept
    flow = case.flow
    settings = case.config.simulated_pressure
    return simulated_pressure.at_frames(
        flow,
        model.law,
        model.law.to_physical(model.theta.tolist(), model.scales.pressure),
        velocity_of(flow, model),
        settings.frames,
        settings.cells,
        wall_friction=case.config.side_walls.friction,
        pool=pool,
        deadline=deadline,
        listener=say,
    )


def compared(case: Case, fields: Fields, record: SimulatedPressure) -> SimulatedPressure:
    """The record with the difference of predicted and simulated pressure."""
    flowing, stagnant = difference(case, fields)
    return replace(record, flowing_percent=flowing, stagnant_percent=stagnant)


def velocity_of(flow: Flow, model: Model) -> simulated_pressure.Velocity:
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
    return replace(fields, values=fields.values | {"p_simulated": values})


def difference(case: Case, fields: Fields) -> tuple[float | None, float | None]:
    """rms difference of predicted and simulated pressure over the rms of the simulated one, in %.

    One value for the flowing points and one for the stagnant points; None for an empty zone.
    """
    p, simulated = fields.values["p"], fields.values["p_simulated"]
    known = np.isfinite(simulated)
    split = scoring.zones_of(case.flow, fields, case.of_flow.strain_rate)
    flowing, stagnant = (
        relative_l2(p[known & zone], simulated[known & zone])
        for zone in (split.flowing, split.stagnant)
    )
    return flowing, stagnant
