"""A simulation with the identified law against the data: a check that takes the law alone.

The simulation starts from the grains of the first frame (second_opinion/scenes.py) and writes its
frames at the times of the data.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from granpinn.data import Flow
from granpinn.data.norms import rms
from granpinn.data.steady import steady_mean
from granpinn.data.symmetry import with_layer
from granpinn.fit.context import Context
from granpinn.physics.laws import FrictionLaw
from granpinn.results import plain
from granpinn.results.record import Check, Record
from granpinn.second_opinion import layers
from granpinn.second_opinion.comparison import Comparison, compare
from granpinn.second_opinion.scenes import GrainColumn, scene_of
from granpinn.simulation.progress import SilentSimulation, SimulationLines
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import record

Numbers = tuple[float | None, ...]  # None: not known


@dataclass(frozen=True)
class Curves:
    """The two flows over time (second_opinion/comparison.py)."""

    t: Numbers
    front: Numbers
    front_simulated: Numbers
    velocity_percent: Numbers
    profile_rms: Numbers
    x: Numbers
    frames: tuple[int, ...]
    profiles: tuple[Numbers, ...]
    profiles_simulated: tuple[Numbers, ...]

    @classmethod
    def of(cls, comparison: Comparison) -> Curves:
        """The curves of a comparison, for a file."""

        def tuples(value: Any) -> Any:
            return tuple(map(tuples, value)) if isinstance(value, list) else value

        return cls(**{name: tuples(plain(v)) for name, v in comparison._asdict().items()})

    def comparison(self) -> Comparison:
        """The same as arrays, with NaN for what is not known."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        arrays: dict[str, Any] = {name: np.array(v, float) for name, v in values.items()}
        return Comparison(**arrays | {"frames": list(self.frames)})


@dataclass(frozen=True)
class Resimulation(Record):
    """The data against a simulation with the identified law.

    `objection` is the reason for the lack of a simulation; all numbers are then None.

    Attributes:
        cells: across the box.
        column: width and height of the column at the start, in the units of the file; None for a
            layer on a slope, which has no front either.
        layer: depth of this layer.
        velocity_percent: relative L2 error of the velocity over the common points, eq. (errorL2).
        common_percent: share of the points of the data that the simulation has too.
        front_percent, front_worst_percent: rms and largest difference of the fronts, relative to
            the initial height.
        profile_percent: rms difference of the surface profiles, relative to the initial height.
        curves: both flows over time.
    """

    title = "Simulated with the identified law"
    notes = (
        "The grains of the first frame were released with the identified law. The simulator has "
        "errors of its own, of 1 to 2 % in the velocity and of a cell at the front."
    )

    objection: str | None
    cells: int | None = None
    column: tuple[float, float] | None = None
    seconds: float | None = None
    velocity_percent: float | None = None
    common_percent: float | None = None
    front_percent: float | None = None
    front_worst_percent: float | None = None
    profile_percent: float | None = None
    layer: float | None = None
    curves: Curves | None = None

    @property
    def words(self) -> str:
        if self.objection is not None:
            return f"not simulated again: {self.objection}"
        text = (
            f"simulated again with this law: velocity off by {self.velocity_percent:.2f} % on "
            f"{self.common_percent:.0f} % of the points"
        )
        if self.layer is not None:
            return f"{text}; no fit of the simulator, which exists for collapses alone"
        return text + (
            f", front by {self.front_percent:.2f} % and surface by {self.profile_percent:.2f} % of "
            f"the initial height (rms)"
        )

    def figures(self) -> dict[str, tuple[str, Callable[[Any], Any]]]:
        if self.curves is None:
            return {}
        from granpinn.figures.checks import resimulation  # matplotlib is loaded when it is used

        comparison = self.curves.comparison()
        return {
            "resimulation": (
                self.title,
                lambda s: resimulation(comparison, s.fields.units if s.fields else None),
            )
        }


def resimulate(
    flow: Flow,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None = None,
    listener: SilentSimulation | None = None,
    wall_friction: float | None = None,
) -> Resimulation:
    """Simulate with an identified law and compare with the data.

    Args:
        flow: the file's own data, without added noise.
        theta, cells, wall_friction: as in `scenes.collapse_of`.

    Raises:
        SimulationError: a solve did not converge.
    """
    flow = steady_mean(with_layer(flow))
    posed = scene_of(flow, law, theta, cells, wall_friction)
    if isinstance(posed, str):
        return Resimulation(posed)
    scene, start = posed
    begin = time.monotonic()
    recorder = Recorder(scene)
    record(recorder, listener or SilentSimulation(), flow.t.tolist())
    seconds = time.monotonic() - begin
    simulated = recorder.flow()
    curves, whole = compare(flow, layers.spread(simulated, flow.x) if flow.periodic else simulated)
    found = Resimulation(
        objection=None,
        cells=scene.cells,
        seconds=seconds,
        velocity_percent=whole.velocity_percent,
        common_percent=whole.common_percent,
    )
    if not isinstance(start, GrainColumn):
        none = np.full(len(flow.t), np.nan)
        curves = curves._replace(front=none, front_simulated=none)
        return replace(found, layer=start, curves=Curves.of(curves))
    front = (curves.front_simulated - curves.front) / start.height
    return replace(
        found,
        column=(start.width, start.height),
        front_percent=100 * rms(front),
        front_worst_percent=100 * float(np.nanmax(np.abs(front))),
        profile_percent=100 * rms(curves.profile_rms) / start.height,
        curves=Curves.of(curves),
    )


def make(context: Context) -> Resimulation:
    config, result = context.case.config, context.result
    return resimulate(
        context.case.flow,
        result.friction_law,
        result.theta,
        config.resimulation.cells,
        SimulationLines(context.run.progress.message),
        config.side_walls.friction,
    )


CHECK = Check("resimulation", Resimulation, make, seconds=60.0, flag="resimulate", quick=False)
