r"""A parametric bootstrap: how well the law comes back from flows that are simulated with it.

1. The scene of the flow is simulated with the identified law (second_opinion/scenes.py),
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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.fit.case import member_seed
from granpinn.fit.context import Context, values_alone
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.record import CARE, Check, Reason, Record, Table
from granpinn.results.summary import NORMAL_90
from granpinn.second_opinion.drawn_noise import DrawnNoise, noise_of, with_noise
from granpinn.second_opinion.sampled import Sampler
from granpinn.second_opinion.scenes import scene_of
from granpinn.second_opinion.threads import UntilStopped, threads
from granpinn.simulation.run import record
from granpinn.simulation.scene import Scene
from granpinn.training.guard import NonFiniteError
from granpinn.training.progress import Progress, by_default

NUDGE = 1e-6  # relative difference between the laws of two flows
PLACES = (0.0, 0.5, 1.0)  # of mu(I), on the curve of the law


FEWEST = 2  # flows that have a scatter


@dataclass(frozen=True)
class Recovery:
    """How far identifications were off one number of the law.

    Attributes:
        value: of the identified law, with which the flows were simulated.
        bias: mean error over the flows; scatter: standard deviation of the errors; rms: root mean
            square error.
        bias_error, scatter_error, rms_error: their standard errors.
        std: standard deviation by the error bars of the result; None where there are none.
    """

    value: float
    bias: float
    bias_error: float
    scatter: float
    scatter_error: float
    rms: float
    rms_error: float
    std: float | None = None

    def __post_init__(self) -> None:
        for name in ("bias_error", "scatter", "scatter_error", "rms", "rms_error", "std"):
            if (value := getattr(self, name)) is not None and value < 0:
                raise ValueError(f"{name} must not be negative, got {value}")

    @property
    def exceeds(self) -> bool:
        """Whether the rms error is larger than the stated standard deviation, by more than two
        standard errors."""
        return self.std is not None and self.rms - 2 * self.rms_error > self.std

    @property
    def texts(self) -> tuple[str, ...]:
        """Bias, scatter, rms error and stated standard deviation with four digits."""
        return (
            f"{self.bias:+.4f} +- {self.bias_error:.4f}",
            f"{self.scatter:.4f} +- {self.scatter_error:.4f}",
            f"{self.rms:.4f} +- {self.rms_error:.4f}",
            "-" if self.std is None else f"{self.std:.4f}",
        )


@dataclass(frozen=True)
class Bootstrap(Record):
    """Identifications of simulated flows.

    `objection` is the reason for the lack of a simulation; the record is then empty.

    Attributes:
        flows: number of simulated flows whose identification ended.
        diverged: number of those whose training diverged; they do not count.
        cells: across the box, or across the layer.
        steps: of every training.
        noise_percent: standard deviation of the noise that was drawn for u and for v, relative to
            the rms speed of the data; `--noise` comes on top.
        vectors_per_independent: of this noise, 1 for white noise.
        noise_left_out: the number that was measured where the drawn noise is white all the same.
        seconds: for simulations and trainings.
        parameters: the identified parameters.
        I: inertial numbers of the data [n]; friction: mu at each of them.
    """

    title = "Found again in simulated flows"
    notes = (
        "Bias: mean error. Scatter: standard deviation over the flows. +- is one standard error. "
        "This holds for flows of exactly this law, made by the simulator of granpinn. It contains "
        "neither the departure of nature from the law nor the errors of another solver."
    )

    objection: str | None
    flows: int = 0
    diverged: int = 0
    cells: int | None = None
    steps: int | None = None
    noise_percent: float | None = None
    vectors_per_independent: float = 1.0
    noise_left_out: float | None = None
    seconds: float | None = None
    parameters: dict[str, Recovery] = field(default_factory=dict)
    I: tuple[float, ...] = ()
    friction: tuple[Recovery, ...] = ()

    def __post_init__(self) -> None:
        if len(self.I) != len(self.friction):
            raise ValueError(
                f"I and friction must have equally many values, got {len(self.I)} and "
                f"{len(self.friction)}"
            )
        if self.objection is None and self.flows < FEWEST:
            raise ValueError(f"flows must be at least {FEWEST}, got {self.flows}")

    @property
    def rows(self) -> list[tuple[str, Recovery]]:
        """The parameters, then mu at every I, with their names."""
        names = [f"mu({number:.2g})" for number in self.I]
        return [*self.parameters.items(), *zip(names, self.friction, strict=True)]

    @property
    def words(self) -> str:
        if self.objection is not None:
            return f"no flows simulated with this law: {self.objection}"
        lost = f", {self.diverged} more diverged" if self.diverged else ""
        return (
            f"errors in {self.flows} flows that were simulated with this law and identified in the "
            f"same way ({self.cells} cells, {self.noise}{lost}):"
        )

    @property
    def table(self) -> Table | None:
        if self.objection is not None:
            return None
        head = ("", "bias", "scatter", "rms error", "stated std")
        return Table(head, [(name, *row.texts) for name, row in self.rows])

    def reasons(self, result: Result) -> list[Reason]:
        parts = [
            f"{name} ({row.rms:.2g} +- {row.rms_error:.1g} against {row.std:.2g})"
            for name, row in self.rows
            if row.exceeds
        ]
        if not parts:
            return []
        text = (
            "The error bars may be too narrow: the rms error of flows simulated with this law "
            f"exceeds the stated standard deviation of {', '.join(parts)}."
        )
        return [Reason(CARE, text)]

    @property
    def noise(self) -> str:
        """The noise that was drawn, in words."""
        percent = f"{self.noise_percent or 0.0:.2f}"
        if not float(percent):
            return "no noise to draw"
        size = f"noise of {percent} % of the rms speed"
        if self.noise_left_out is not None:
            return (
                f"white {size}, although {self.noise_left_out:.2g} measured vectors count as one "
                f"independent one"
            )
        if self.vectors_per_independent > 1:
            number = f"{self.vectors_per_independent:.2g}"
            return f"correlated {size}, {number} vectors for one independent one"
        return f"white {size}"


def bootstrap(
    measured: Flow,
    result: Result,
    config: Config,
    identify_many: Callable[..., Sequence[Result]],
    *,
    run_dir: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Bootstrap:
    """Simulate flows with the law of a result, identify them as one batch, and compare.

    Args:
        measured: the flow of the result, as its case has it.
        result: its law, steps and error bars.
        config: its settings; `calibration` has the number of flows.
        identify_many: `granpinn.identify_many`, whose arguments are `run_dir` and `progress`.

    Raises:
        As `identify_many`; SimulationError if a solve did not converge; NonFiniteError if fewer
        than two trainings ended.
    """
    begin, listener = time.monotonic(), progress or by_default()
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
    """The settings of the run, with its fixed parameters and steps, for values alone."""
    fixed = tuple(
        f"{name}={p.value!r}" for name, p in result.parameters.items() if p.fixed and name != "I0"
    )
    return dataclasses.replace(
        values_alone(config),
        steps=result.timing.steps,
        max_time=None,
        rheology=dataclasses.replace(config.rheology, fix=fixed or None),
        side_walls=dataclasses.replace(config.side_walls, friction_sd=0.0),
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


def make(context: Context) -> Bootstrap:
    assert context.identify_many is not None
    return bootstrap(
        context.case.flow,
        context.result,
        context.case.config,
        context.identify_many,
        run_dir=None if context.runs is None else context.runs / "bootstrap",
        progress=context.run.progress,
    )


CHECK = Check(
    "bootstrap", Bootstrap, make, seconds=1200.0, flag="calibrate", quick=False, trains=True
)
