"""Slips of unit, sign and order in a flow file, seen from the conservation of mass and energy.

All checks compare the flow with itself, so they need no model and no training:

- **Volume and center of mass**: the gradients of u and v, and the motion of c, must fit u and v
  (granpinn/inspection/conservation.py).
- **Energy.** Grains that fall a height H reach sqrt(2 |g| H), and friction makes them slower. H is
  the height of everything that held grains in any frame. Grains that enter the grid may have
  fallen farther, and walls can drive them: only a closed flow is bound by it.
- A closed flow with no moving walls never raises its center of mass.
- **Momentum.** A steady flow has the same mean velocity in all its frames.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow, FlowFileError, FlowFileWarning
from granpinn.data.scaling import initial_height
from granpinn.inspection.conservation import Center, Volume, center_of, volume_of

# Frames are taken evenly from the whole flow, so many at most, and fewer of a large grid.
MOST_FRAMES, FEWEST_FRAMES, MOST_CELLS = 48, 16, 1_000_000
# Largest factor that is an error of measurement, and least factor that no measurement explains.
GRADIENTS_DIFFER, CENTER_DIFFERS, IMPOSSIBLE = 3.0, 5.0, 10.0
# Speeds over that of a free fall: improbable and impossible, in closed flows and in others. A chute
# may be far longer than the grid, but not fall from 10^4 times its height.
CLOSED_FAST, OPEN_FAST = (3.0, 10.0), (10.0, 100.0)
FASTEST = 0.99  # quantile
RISE = 0.1  # of the height of the grains
UNSTEADY = 0.01  # of gravity, the acceleration of a flow that is stated as steady


@dataclass(frozen=True)
class Slip:
    """A likely mistake in a flow file.

    Attributes:
        severity: "impossible" contradicts the conservation of mass or energy.
        text: one sentence: what contradicts what, and what to check.
    """

    severity: Literal["impossible", "improbable"]
    text: str


def slips(flow: Flow) -> list[Slip]:
    """Slips of unit, sign and order in a flow, the most certain first; none in sound data.

    Scattered vectors are compared with a free fall only. The cost is that of `MOST_FRAMES` frames.
    """
    with np.errstate(all="ignore"):  # what is not finite decides nothing
        return sorted(_slips(flow), key=lambda slip: slip.severity != "impossible")


def refuse_slips(flow: Flow) -> None:
    """Refuses impossible data, and warns of improbable ones with a FlowFileWarning.

    Raises:
        FlowFileError: for the first impossible slip.
    """
    name = "" if flow.path is None else f"{flow.path}: "
    for slip in slips(flow):
        if slip.severity == "impossible":
            raise FlowFileError(f"{name}{slip.text}")
        warnings.warn(f"{name}{slip.text}", FlowFileWarning, stacklevel=3)


def _slips(flow: Flow) -> list[Slip]:
    height = _height(flow)
    if flow.particles is not None:
        p = flow.particles
        return _against_fall(flow, np.hypot(p.u, p.v, dtype=np.float64), height, closed=False)
    size = int(np.clip(MOST_CELLS // flow.c[0].size, FEWEST_FRAMES, MOST_FRAMES))
    frames = np.unique(np.linspace(0, flow.t.size - 1, size).round().astype(int))
    valid = flow.valid[frames]
    u, v = (np.where(valid, a[frames], np.nan).astype(np.float64) for a in (flow.u, flow.v))
    volume = volume_of(flow, u, v)
    center = center_of(flow, frames, u, v, height)
    swapped = volume.swapped
    if not (swapped or center.follows):
        other = center_of(flow, frames, v, u, height)
        swapped = other.follows and not any(_beyond(r, CENTER_DIFFERS) for r in other.ratios)
    if swapped:
        text = "grains keep their volume and move with their velocity only if u and v, or the "
        return [
            Slip("impossible", f"{text}axes x and y of the arrays, are swapped: swap them back")
        ]
    found = _orientation(volume, center) or _factors(volume, center)
    found += _unsteady(flow)
    found += _against_fall(flow, np.hypot(u[valid], v[valid]), height, center.closed)
    if center.closed and center.rise > RISE and not found:
        found.append(
            Slip(
                "improbable",
                f"the center of mass rises by {center.rise:.0%} of the height of the grains, and "
                "without moving walls it can only fall: check the signs of gravity, y and v",
            )
        )
    return found


def _unsteady(flow: Flow) -> list[Slip]:
    """A steady flow whose mean velocity changes from its first to its last frame."""
    duration = float(flow.t[-1] - flow.t[0])
    both = flow.valid[0] & flow.valid[-1]
    if not flow.steady or duration <= 0 or not both.any():
        return []
    change = [float(np.mean(a[-1][both] - a[0][both], dtype=np.float64)) for a in (flow.u, flow.v)]
    part = math.hypot(*change) / duration / math.hypot(*flow.gravity)
    if part <= UNSTEADY:
        return []
    text = (
        "the flow is stated as steady, but from its first to its last frame the mean velocity "
        f"changes as by an acceleration of {part:.1%} of gravity, which the equations lack: mu "
        f"will be wrong by about {part:.2g}; average later frames, or give all frames without "
        "`steady`"
    )
    return [Slip("improbable", text)]


def _height(flow: Flow) -> float:
    """Extent along gravity of all places that held grains, in the unit of the file."""
    if flow.particles is not None:
        places = flow.height(flow.particles.x, flow.particles.y)
    else:
        rows, columns = np.nonzero(flow.material.any(axis=0))
        places = flow.height(flow.x[columns], flow.y[rows])
    return max(float(np.ptp(places)), initial_height(flow))


def _orientation(volume: Volume, center: Center) -> list[Slip]:
    """Components with the wrong sign."""
    in_x, in_y = (None if ratio is None else ratio > 0 for ratio in center.ratio)
    if volume.ratio is not None:  # the volume ties the sign of one component to the other
        in_x = (in_y != volume.mirrored) if in_x is None and in_y is not None else in_x
        in_y = (in_x != volume.mirrored) if in_y is None and in_x is not None else in_y
    if in_x is not False and in_y is not False:
        if not volume.mirrored or in_x is not None:
            return []
        wrong = "u_x = +v_y where grains that keep their volume have u_x = -v_y: u or v"
        return [Slip("impossible", f"{wrong} (or x or y) has the wrong sign")]
    where = "x and y" if in_x is in_y else "y" if in_x is not False else "x"
    cause = {
        "x": "u (or x) has the wrong sign",
        "y": "v (or y) is upside down",
        "x and y": "u and v have the wrong sign, or time runs backward",
    }[where]
    against = f"the center of mass moves against the velocity of the grains in {where}"
    return [Slip("impossible", f"{against}: {cause}")]


def _factors(volume: Volume, center: Center) -> list[Slip]:
    """Components, times and places in units that do not fit together."""
    n = {axis: r for axis, r in zip("xy", center.ratio, strict=True) if r is not None}
    far = {axis: r for axis, r in n.items() if _beyond(r, CENTER_DIFFERS)}
    if far and (len(n) == 1 or not _beyond(n["x"] / n["y"], GRADIENTS_DIFFER)):
        ratio = math.exp(sum(map(math.log, n.values())) / len(n))
        parts = "u and v, t, or x and y"
    elif far:
        axis, ratio = max(far.items(), key=lambda item: abs(math.log(item[1])))
        parts = {"x": "u or x", "y": "v or y"}[axis]
    elif volume.ratio is not None and _beyond(volume.ratio, GRADIENTS_DIFFER):
        return [
            Slip(
                _severity(volume.ratio),
                f"v_y is {_about(volume.ratio)} -u_x, and they are equal if grains keep their "
                "volume: x and y, or u and v, are not in the same unit",
            )
        ]
    else:
        return []
    return [
        Slip(
            _severity(ratio),
            f"the velocity integrated over time is {_about(ratio)} the way of the center of "
            f"mass: check the units of {parts}",
        )
    ]


def _against_fall(flow: Flow, speeds: Float64, height: float, closed: bool) -> list[Slip]:
    """Speeds that no free fall reaches."""
    if speeds.size == 0:
        return []
    fall = math.sqrt(2 * math.hypot(*flow.gravity) * height)
    ratio = float(np.quantile(speeds, FASTEST)) / fall
    fast, too_fast = CLOSED_FAST if closed else OPEN_FAST
    if not ratio > fast:
        return []
    return [
        Slip(
            "impossible" if ratio > too_fast else "improbable",
            f"grains move at {_about(ratio)} the speed of a free fall through the height of "
            "all grains: check the units of u and v, x and y, and gravity",
        )
    ]


def _beyond(ratio: float, factor: float) -> bool:
    return not 1 / factor <= ratio <= factor


def _severity(ratio: float) -> Literal["impossible", "improbable"]:
    return "impossible" if _beyond(ratio, IMPOSSIBLE) else "improbable"


def _about(ratio: float) -> str:
    """A factor with two digits, such as "980 times" or "1/980 of"."""
    size = max(ratio, 1 / ratio)
    text = f"{float(f'{size:.2g}'):,g}" if size < 1e6 else f"{size:.1e}"
    return f"{text} times" if ratio >= 1 else f"1/{text} of"
