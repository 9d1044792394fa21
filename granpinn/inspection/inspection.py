"""The inspection of a flow before training: all its parts, and their numbers."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.config import SideWalls
from granpinn.data import Flow, with_partial_cells
from granpinn.data.large import middle
from granpinn.data.noise import max_speed
from granpinn.data.scaling import scales_of
from granpinn.data.steady import steady_mean
from granpinn.data.symmetry import with_layer, words
from granpinn.data.wall_points import WallFacts, walls_of
from granpinn.estimates.facts import Facts
from granpinn.estimates.gradients import Gradients
from granpinn.estimates.noise import Noise
from granpinn.estimates.view import View
from granpinn.inspection.baseline import I0, baseline
from granpinn.inspection.body import body_of
from granpinn.inspection.checks import Counts, Motion, counts, motion
from granpinn.inspection.confined import undetermined
from granpinn.inspection.fall import Fall, fall_of
from granpinn.inspection.inertia import Inertia, InertialNumbers, inertial_numbers
from granpinn.inspection.precision import AssumedLaw, Precision, expected_precision
from granpinn.inspection.size_slips import not_dense
from granpinn.inspection.slips import slips
from granpinn.physics.scales import Scales
from granpinn.results.baseline import Baseline
from granpinn.results.slip import UNUSUAL, Slip

# With a smaller share or number of flowing vectors, no precision is estimated.
LEAST_FLOWING = 0.01
FEWEST_FLOWING = 200


@dataclass(frozen=True)
class Kinematics:
    """Shear and volume.

    Attributes:
        window: cells across the windows in which velocities were differentiated.
        flowing: share of the vectors in cells that flow.
        shear_rate: its median in these cells, in units of sqrt(|g| / H0).
        shear_rate_error: median of its standard deviation.
        divergence: rms of div v over rms of the shear rate, both where it flows, less noise.
    """

    window: int
    flowing: float
    shear_rate: float | None
    shear_rate_error: float
    divergence: float | None


@dataclass(frozen=True)
class SurfaceFacts:
    """The free surface: number of points, and share of the frames with points."""

    points: int
    frames: float


@dataclass(frozen=True, eq=False)
class Inspection:
    """Quality of a flow, and expected precision of its friction law.

    Attributes:
        symmetries: in which directions the flow does not change, in words.
        slips: likely mistakes of unit, sign or order, the most certain first.
        law: the friction law for which `inertia` and `precision` hold.
        noise: dimensionless; times `scales.velocity` in the units of the file.
        stated_sigma: median of the standard deviation in the file, dimensionless, or None.
        precision: None if it cannot be estimated, for the `reason`.
        I: inertial number at the cells of `gradients` [K].
        flows: whether these cells flow [K].
        noise_cells: noise of every cell [Y, X], dimensionless.
        baseline: the friction from the momentum balance alone.
        fall: the fastest acceleration of a side of the grains into the body, over |g|, or None.
        walls: what the vectors show of each wall of the file.
        undetermined: why the flow gives no friction coefficient, or None (confined.py).
    """

    flow: Flow
    scales: Scales
    symmetries: tuple[str, ...]
    slips: list[Slip]
    law: AssumedLaw
    counts: Counts
    noise: Noise
    stated_sigma: float | None
    motion: Motion
    kinematics: Kinematics
    inertia: Inertia | None
    surface: SurfaceFacts | None
    precision: Precision | None
    reason: str | None
    view: View
    gradients: Gradients
    I: Float64
    flows: Bool
    noise_cells: Float64
    baseline: Baseline
    fall: Fall | None
    walls: tuple[WallFacts, ...] = ()
    undetermined: str | None = None

    def numbers(self) -> dict[str, Any]:
        """All numbers, for inspect.json; `noise` in units of the file and of the largest speed."""
        plain = ("counts", "motion", "fall", "kinematics", "inertia", "surface")
        found: dict[str, Any] = {"symmetries": list(self.symmetries)}
        found["slips"] = [dataclasses.asdict(slip) for slip in self.slips]
        for name in plain:
            part = getattr(self, name)
            found[name] = None if part is None else dataclasses.asdict(part)
        found["precision"] = None if self.precision is None else vars(self.precision)
        found["precision_refused_because"] = self.reason
        law = self.law.friction_law
        found["walls"] = [dict(vars(wall)) for wall in self.walls]
        found["friction_refused_because"] = self.undetermined
        found["momentum_balance"] = dataclasses.asdict(self.baseline)
        found["law"] = {"name": law.name, **dict(zip(law.names, self.law.theta, strict=True))}
        found["noise"] = {
            name: self._in_file_units(value) if name != "vectors_per_independent" else value
            for name, value in dataclasses.asdict(self.noise).items()
        }
        found["noise"]["stated"] = self._in_file_units(self.stated_sigma)
        found["noise"]["relative_to_largest_speed"] = self.relative_noise
        found["units"] = {
            "length": self.flow.length_unit,
            "time": self.flow.time_unit,
            "initial_height": self.scales.length,
            "velocity_scale": self.scales.velocity,
        }
        return found

    def _in_file_units(self, value: float | None) -> float | None:
        return None if value is None else value * self.scales.velocity

    @property
    def relative_noise(self) -> float | None:
        """Standard deviation of a component over the largest speed; None if either is unknown."""
        if self.noise.sigma is None or not self.motion.speed > 0:
            return None
        return self.noise.sigma * self.scales.velocity / self.motion.speed


def inspect(
    flow: Flow, law: AssumedLaw | None = None, side_walls: SideWalls | None = None
) -> Inspection:
    """Inspects a flow without training; the precision is that of `law`.

    Of a large flow, all but slips and fall is that of one run of frames (`large.middle`), which is
    then the flow of the inspection; of a steady flow, its mean over time (`steady.steady_mean`).
    """
    law = law or AssumedLaw()
    filmed = with_layer(flow)
    whole = steady_mean(filmed)
    flow, scales = middle(whole), scales_of(whole)
    facts = Facts(flow, scales)
    view, noise, found = facts.view, facts.noise, facts.slopes
    speed = _largest_speed(flow, scales, found)
    gamma_dot = found.gamma_dot
    numbers = inertial_numbers(facts)
    I, flows = numbers.I, numbers.flows
    law = law.in_units(scales.pressure).at_quantiles(numbers.quantiles)
    precision, reason = _precision(found, numbers, scales.pressure, noise, law)
    walls = walls_of(with_partial_cells(flow))
    inertia = numbers.summary(law)
    likely = slips(filmed)
    if all(slip.severity == UNUSUAL for slip in likely):  # others would explain it
        gas = not_dense(flow, inertia)
        likely = [*gas, *likely]
        if gas:
            precision, reason = None, "its inertial numbers are not those of a dense flow"
    refused = undetermined(flow, "V0" if flow.surface is None else "V1")
    if refused is not None:
        precision, reason = None, refused
    return Inspection(
        flow=flow,
        scales=scales,
        symmetries=words(facts.invariant),
        slips=likely,
        law=law,
        counts=counts(flow, view),
        noise=noise,
        stated_sigma=_stated(flow, scales),
        motion=motion(flow, view, found, speed),
        kinematics=_kinematics(found, gamma_dot, flows),
        inertia=inertia,
        surface=_surface(flow),
        precision=precision,
        reason=reason,
        view=view,
        gradients=found,
        I=I,
        flows=flows,
        noise_cells=facts.noise_cells,
        baseline=baseline(flow, law.inertial_scale or I0, side_walls),
        fall=None if flow.steady else fall_of(whole, body_of(whole)),
        walls=() if walls is None else tuple(walls[2]),
        undetermined=refused,
    )


def _largest_speed(flow: Flow, scales: Scales, found: Gradients) -> float:
    """The largest speed in the units of the file, of the smoothed velocity where there is one.

    The largest of many noisy speeds consists mostly of noise.
    """
    largest = max_speed(flow)
    if found.u.size == 0:
        return largest
    smooth = float(np.hypot(found.u, found.v).max()) * scales.velocity
    return min(largest, smooth)


def _stated(flow: Flow, scales: Scales) -> float | None:
    """Median standard deviation that the file states, dimensionless."""
    if flow.particles is not None and flow.particles.sigma_u is not None:
        sigma: Any = (flow.particles.sigma_u, flow.particles.sigma_v)
    elif flow.sigma_u is None or flow.sigma_v is None:
        return None
    else:
        sigma = [np.broadcast_to(s, flow.valid.shape) for s in (flow.sigma_u, flow.sigma_v)]
        sigma = [s[flow.valid] for s in sigma]
    middle = [float(np.median(s)) for s in sigma]
    return math.hypot(*middle) / math.sqrt(2) / scales.velocity


def _kinematics(found: Gradients, gamma_dot: Float64, flows: Bool) -> Kinematics:
    weight = found.vectors.sum()
    divergence = None
    if flows.any():
        # var(u_x + v_y) of noise is the sum of both, half of what gamma_dot^2 has.
        square = float(np.mean(found.divergence[flows] ** 2 - found.bias[flows] / 2))
        divergence = float(np.sqrt(max(square, 0.0) / np.mean(gamma_dot[flows] ** 2)))
    return Kinematics(
        window=2 * found.half_width + 1,
        flowing=float(found.vectors[flows].sum() / weight) if weight else 0.0,
        shear_rate=float(np.median(gamma_dot[flows])) if flows.any() else None,
        shear_rate_error=float(np.sqrt(np.median(found.bias) / 2)) if found.u.size else 0.0,
        divergence=divergence,
    )


def _surface(flow: Flow) -> SurfaceFacts | None:
    if flow.surface is None:
        return None
    middle = (flow.t[1:] + flow.t[:-1]) / 2
    frames = np.unique(np.searchsorted(middle, flow.surface.t)).size
    return SurfaceFacts(points=flow.surface.t.size, frames=frames / flow.t.size)


def _precision(
    found: Gradients,
    numbers: InertialNumbers,
    pressure_unit: float,
    noise: Noise,
    law: AssumedLaw,
) -> tuple[Precision | None, str | None]:
    """The expected precision, or the reason why there is none."""
    I, flows, p = numbers.I, numbers.flows, numbers.p * pressure_unit
    vectors = found.vectors / noise.vectors_per_independent
    moving, total = float(found.vectors[flows].sum()), float(found.vectors.sum())
    if noise.sigma is None:
        return None, "the noise cannot be estimated from so few vectors"
    if moving < max(LEAST_FLOWING * total, FEWEST_FLOWING):
        share = 100 * moving / total if total else 0.0
        return None, (
            f"the grains hardly shear ({share:.1f} % of the vectors flow measurably), and friction "
            "shows only where they do"
        )
    result = expected_precision(
        found.gamma_dot[flows], I[flows], vectors[flows], noise.sigma, law, p[flows]
    )
    if result is None:
        return None, "all vectors have nearly the same inertial number, which fixes no law"
    return result, None
