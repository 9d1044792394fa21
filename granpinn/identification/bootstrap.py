r"""A parametric bootstrap: how well the law comes back from flows that are simulated with it.

1. The scene of the flow is simulated with the identified law (second_opinion/resimulation.py),
   once for every flow of the bootstrap. Runs are rough: laws that differ by a millionth have other
   splashes and shear bands. So the laws of the flows differ by multiples of a millionth.
2. Each simulation is sampled as the data are (second_opinion/sampled.py), and its vectors get a
   draw of the measured noise (second_opinion/drawn_noise.py), and of the added noise if the
   settings have one.
3. All flows are identified as one batch, with the settings and steps of the run and seeds of their
   own.

With the errors e_k of n identifications,

$$ b = \bar e, \quad s^2 = \sum_k (e_k - b)^2 / (n - 1), \quad r^2 = \overline{e^2} $$

are bias, scatter and rms error. Their standard errors are s/sqrt(n), s/sqrt(2(n - 1)) (exact to
first order in 1/n for normal errors) and sd(e^2)/(2 r sqrt(n)) (by the delta method).

Fixed parameters stay those of the result. The surface line of the flows and the friction of side
walls are exact, so that no effect of an assumption is trained.
"""

from __future__ import annotations

import dataclasses
import math
import os
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Event

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.data.large import spread
from granpinn.identification.batch import identify_many
from granpinn.identification.case import member_seed, sound
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.bootstrap import FEWEST, Bootstrap, Recovery
from granpinn.results.summary import NORMAL_90
from granpinn.second_opinion.drawn_noise import DrawnNoise, noise_of, with_noise
from granpinn.second_opinion.resimulation import scene_of
from granpinn.second_opinion.sampled import Sampler
from granpinn.second_opinion.threads import UntilStopped, threads
from granpinn.simulation.run import record
from granpinn.simulation.scene import Scene
from granpinn.training.guard import NonFiniteError
from granpinn.training.progress import Progress, by_default

NUDGE = 1e-6  # relative difference between the laws of two flows
PLACES = (0.0, 0.5, 1.0)  # of mu(I), on the curve of the law


def bootstrap(
    flow: Flow | str | os.PathLike[str],
    result: Result,
    config: Config,
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Bootstrap:
    """Simulate flows with the law of a result, identify them as one batch, and compare.

    Args:
        flow: of the result.
        result: its law, steps and error bars.
        config: its settings; `calibration` has the number of flows.
        run_dir, progress: as for `identify_many`.

    Raises:
        As `identify_many`; SimulationError if a solve did not converge; NonFiniteError if fewer
        than two trainings ended.
    """
    begin, listener = time.monotonic(), progress or by_default()
    measured = spread(sound(flow)[0])
    law, n = LAWS[config.law], config.calibration.flows
    scenes: list[Scene] = []
    for k in range(n):
        theta = [
            value * (1 + NUDGE * k * (name in law.free))
            for name, value in zip(law.names, result.theta, strict=True)
        ]
        friction = config.side_walls.friction
        posed = scene_of(measured, law, theta, config.resimulation.cells, friction)
        if isinstance(posed, str):
            return Bootstrap(posed)
        scenes.append(posed[0])
    flows, noise = simulated_flows(measured, scenes, config, listener)
    found = identify_many(
        flows,
        settings(config, result),
        seeds_of(config, n),
        run_dir=None if run_dir is None else Path(run_dir),
        keep_fields=False,
        progress=progress,
    )
    return dataclasses.replace(
        compared(result, found),
        cells=scenes[0].cells,
        noise_percent=noise.percent,
        vectors_per_independent=noise.vectors_per_independent,
        noise_left_out=noise.left_out,
        seconds=time.monotonic() - begin,
    )


def simulated_flows(
    measured: Flow, scenes: Sequence[Scene], config: Config, listener: Progress
) -> tuple[list[Flow], DrawnNoise]:
    """The flows of the scenes, sampled as the measured one, with the noise that each has."""
    n, cores, stopped = len(scenes), len(os.sched_getaffinity(0)), Event()
    begin = time.monotonic()
    listener.message(f"simulating {n} flows with the identified law, {scenes[0].cells} cells")

    def simulated(scene: Scene) -> Flow:
        sampler = Sampler(dataclasses.replace(scene, threads=max(1, cores // n)), measured)
        record(sampler, UntilStopped(stopped), measured.t.tolist())
        return sampler.flow()

    flows = []
    try:
        with threads(min(n, cores)) as pool:
            for made in [pool.submit(simulated, scene) for scene in scenes]:
                flows.append(made.result())
                seconds = time.monotonic() - begin
                listener.message(f"simulated {len(flows)} of {n} flows after {seconds:.0f} s")
    finally:
        stopped.set()
    noise = noise_of(measured, flows[0])
    draws = [member_seed(config.seed, config.members + n + k) for k in range(n)]
    return [with_noise(*pair) for pair in zip(flows, [noise] * n, draws, strict=True)], noise


def seeds_of(config: Config, n: int) -> list[int]:
    """Seeds that neither the run nor its members have."""
    return [member_seed(config.seed, config.members + k) for k in range(n)]


def settings(config: Config, result: Result) -> Config:
    """The settings of the run, with its fixed parameters and steps, and without its later parts."""
    fixed = tuple(
        f"{name}={p.value!r}" for name, p in result.parameters.items() if p.fixed and name != "I0"
    )
    return dataclasses.replace(
        config,
        steps=result.timing.steps,
        max_time=None,
        rheology=dataclasses.replace(config.rheology, fix=fixed or None),
        side_walls=dataclasses.replace(config.side_walls, friction_sd=0.0),
        simulated_pressure=dataclasses.replace(config.simulated_pressure, frames=0),
        compare_laws=False,
        tensorboard=False,
    )


def compared(result: Result, found: Sequence[Result]) -> Bootstrap:
    """The errors of identifications of flows with the law of a result.

    Raises:
        NonFiniteError: fewer than two of them ended.
    """
    law = result.friction_law
    ended = [other.theta for other in found if other.failure is None]
    if len(ended) < FEWEST:
        raise NonFiniteError(
            f"bias and scatter need {FEWEST} flows whose training ends, got {len(ended)}: lower "
            "--optimizer.learning_rate, or give more --calibration.flows"
        )
    laws = np.array(ended)
    parameters = {
        name: recovery(result.theta[i], laws[:, i], result.parameters[name].std)
        for i, name in enumerate(law.names)
        if name in law.free
    }
    curve, places, friction = result.law.curve, list[int](), list[Recovery]()
    if curve is not None:
        places = list(dict.fromkeys(round(at * (len(curve.I) - 1)) for at in PLACES))
    for k in places:
        assert curve is not None
        mu = np.array([float(law.friction(curve.I[k], *theta)) for theta in ended])
        friction.append(recovery(curve.mu[k], mu, _std_of_friction(result, k)))
    return Bootstrap(
        None,
        flows=len(ended),
        diverged=len(found) - len(ended),
        steps=result.timing.steps,
        parameters=parameters,
        I=tuple(curve.I[k] for k in places) if curve else (),
        friction=tuple(friction),
    )


def recovery(value: float, found: Float64, std: float | None) -> Recovery:
    """Bias, scatter and rms error of values [n] that were found for one value."""
    n, errors = len(found), np.asarray(found, np.float64) - value
    scatter, rms = float(errors.std(ddof=1)), math.sqrt(float(np.mean(errors**2)))
    of_squares = float(np.square(errors).std(ddof=1))
    return Recovery(
        value=value,
        bias=float(errors.mean()),
        bias_error=scatter / math.sqrt(n),
        scatter=scatter,
        scatter_error=scatter / math.sqrt(2 * (n - 1)),
        rms=rms,
        rms_error=of_squares / (2 * rms * math.sqrt(n)) if rms else 0.0,
        std=std,
    )


def _std_of_friction(result: Result, k: int) -> float | None:
    """Standard deviation of mu at a point of the curve, to first order (uncertainty/curve.py)."""
    curve, bars = result.law.curve, result.error_bars
    if curve is None or curve.low is None or curve.high is None:
        return None
    half_width = bars.half_width if bars else NORMAL_90
    return (curve.high[k] - curve.low[k]) / (2 * half_width)
