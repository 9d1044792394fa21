"""A simulation with the identified law against the data: a check that takes the law alone.

The simulation starts from the grains of the first frame (simulation/likeness.py) and has frames at
the times of the data: velocity, front and surface are compared.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.data.steady import steady_mean
from granpinn.data.symmetry import with_layer
from granpinn.fit.context import Context
from granpinn.physics.laws import FrictionLaw
from granpinn.results import plain
from granpinn.results.record import Check, Record
from granpinn.simulation.likeness import heights, interpolation, scene_of
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import lines, states

PROFILE_SHARES = (0.1, 0.3, 0.5, 0.75, 1.0)  # of the last time
Numbers = tuple[float | None, ...]  # None: not known


@dataclass(frozen=True)
class Curves:
    """The two flows at the times of the data; lengths in the units of the file.

    Attributes:
        t, front, front_simulated, velocity_percent, profile_rms: [T]; None where there is none.
        x: coordinates of the profiles [X].
        frames: of the profiles [K]; profiles, profiles_simulated: heights of the surface [K, X].
    """

    t: Numbers
    front: Numbers
    front_simulated: Numbers
    velocity_percent: Numbers
    profile_rms: Numbers
    x: Numbers
    frames: tuple[int, ...]
    profiles: tuple[Numbers, ...]
    profiles_simulated: tuple[Numbers, ...]

    def array(self, name: str) -> Float64:
        """One of them as an array, with NaN for what is not known."""
        return np.array(getattr(self, name), float)


@dataclass(frozen=True)
class Resimulation(Record):
    """The data against a simulation with the identified law.

    `objection` is the reason for the lack of a simulation; all numbers are then None.

    Attributes:
        cells: across the box.
        column: width and height of the column at the start, in the units of the file.
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
    curves: Curves | None = None

    @property
    def words(self) -> str:
        if self.objection is not None:
            return f"not simulated again: {self.objection}"
        return (
            f"simulated again with this law: velocity off by {self.velocity_percent:.2f} % on "
            f"{self.common_percent:.0f} % of the points, front by {self.front_percent:.2f} % and "
            f"surface by {self.profile_percent:.2f} % of the initial height (rms)"
        )

    def figures(self) -> dict[str, tuple[str, Callable[[Any], Any]]]:
        if self.curves is None:
            return {}
        from granpinn.figures.checks import resimulation  # matplotlib is loaded when it is used

        curve = self.curves.array
        return {
            "resimulation": (
                self.title,
                lambda s: resimulation(curve, s.fields.units if s.fields else None),
            )
        }


def resimulate(
    flow: Flow,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None = None,
    say: Callable[[str], None] | None = None,
    wall_friction: float | None = None,
) -> Resimulation:
    """Simulate with an identified law and compare with the data.

    Args:
        flow: the file's own data, without added noise.
        theta, cells, wall_friction: as in `likeness.collapse_of`.
        say: takes lines about the progress.

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
    listener = None if say is None else lines(float(flow.t[-1]), say)
    for t, state in states(scene, flow.t.tolist(), listener):
        recorder.add(t, state)
    seconds = time.monotonic() - begin
    record = compare(flow, recorder.flow())
    curves = record.curves
    assert curves is not None
    profile = curves.array("profile_rms")
    front = (curves.array("front_simulated") - curves.array("front")) / start.height
    return replace(
        record,
        cells=scene.cells,
        seconds=seconds,
        column=(start.width, start.height),
        front_percent=100 * float(np.sqrt(np.nanmean(front**2))),
        front_worst_percent=100 * float(np.nanmax(np.abs(front))),
        profile_percent=100 * float(np.sqrt(np.nanmean(profile**2))) / start.height,
    )


def compare(flow: Flow, simulated: Flow) -> Resimulation:
    """The data against a simulation with frames at the same times: velocity and curves."""
    at = interpolation(simulated, flow)
    known, found, of_frame = [], [], []
    for k in range(len(flow.t)):
        own = np.stack([at(simulated.u[k]), at(simulated.v[k])])
        data = np.stack([flow.u[k], flow.v[k]]).astype(np.float64)
        common = flow.valid[k] & np.isfinite(own).all(axis=0)
        known.append(data[:, common])
        found.append(own[:, common])
        of_frame.append(relative_l2(own[:, common], data[:, common]))
    measured, others = heights(flow), heights(simulated)
    others = np.stack([np.interp(flow.x, simulated.x, h, right=0.0) for h in others])
    frames = sorted({int(np.argmin(np.abs(flow.t - s * flow.t[-1]))) for s in PROFILE_SHARES})
    compared = sum(part.shape[1] for part in known)
    curves = {
        "t": flow.t,
        "front": fronts(flow),
        "front_simulated": fronts(simulated),
        "velocity_percent": of_frame,
        "profile_rms": np.sqrt(np.mean((measured - others) ** 2, axis=1)),
        "x": flow.x,
        "frames": frames,
        "profiles": measured[frames],
        "profiles_simulated": others[frames],
    }
    return Resimulation(
        objection=None,
        velocity_percent=relative_l2(np.concatenate(found, 1), np.concatenate(known, 1)),
        common_percent=100 * compared / max(1, int(flow.valid.sum())),
        curves=Curves(**{name: _tuples(plain(values)) for name, values in curves.items()}),
    )


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values


def fronts(flow: Flow) -> Float64:
    """Where the fullest cell of a column is half full, by linear interpolation [T]; else NaN."""
    places = []
    for c in flow.c.max(axis=1).astype(np.float64):
        filled = np.flatnonzero(c > 0.5)
        if filled.size == 0:
            places.append(math.nan)
            continue
        i = int(filled.max())
        after, step = (c[i + 1], flow.x[i + 1] - flow.x[i]) if i + 1 < len(c) else (c[i], 0.0)
        places.append(float(flow.x[i] + step * (c[i] - 0.5) / max(c[i] - after, 1e-12)))
    return np.array(places)


def make(context: Context) -> Resimulation:
    config, result = context.case.config, context.result
    return resimulate(
        context.case.flow,
        result.friction_law,
        result.theta,
        config.simulated_pressure.cells,
        context.run.progress.message,
        config.side_walls.friction,
    )


CHECK = Check("resimulation", Resimulation, make, seconds=60.0, flag="resimulate", quick=False)
