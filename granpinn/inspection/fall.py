r"""Gravity, as the grains of a collapse show it.

- **Fall.** Dry grains push and do not pull. So a free side of the body moves inward, into the
  body, with the acceleration of gravity at most, and with all of it where nothing carries it: at
  the top of a slender column. The mean velocity of the layer there against time has this slope. It
  is within 0.4 % and 0.2 degrees of gravity in columns six times as high as wide, and the mean over
  hundreds of vectors hides the noise (bench/studies/slips).
- **Energy.** Friction takes energy and no wall at rest gives any: the kinetic energy that the
  grains gain is a part of the work of gravity on them, $\int \rho\, g \cdot v$. With lengths or
  velocities in a wrong unit both sides change by different powers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.inspection.body import INWARD, Body

# A fall is measured while the speed of a side rises from the first to the second part of its
# largest, in so many frames; the rest of a straight line is at most this part of it.
RISES = (0.1, 0.7)
FEWEST_FRAMES = 4
STRAIGHT = 0.1
# The energy grows if it was less than this part of its largest at first; as many grains are seen.
GROWS, SAME_GRAINS = 0.7, 0.6
SURE_WORK = 0.2  # largest standard error of the work of gravity, relative


@dataclass(frozen=True)
class Fall:
    """The fastest inward acceleration of a side.

    Attributes:
        side: its name in the axes of the file: left side, right side, bottom or top.
        acceleration: (a_x, a_y) over |g|.
        error: standard error of a component.
        inward: the inward component.
        pull: the inward component of gravity, -1 to 1.
    """

    side: str
    acceleration: tuple[float, float]
    error: float
    inward: float
    pull: float

    @property
    def size(self) -> float:
        """Of the acceleration, over |g|."""
        return math.hypot(*self.acceleration)

    def tilt(self, gravity: tuple[float, float]) -> float:
        """Degrees from gravity to the acceleration, counter-clockwise."""
        (x, y), (g_x, g_y) = self.acceleration, gravity
        return math.degrees(math.atan2(g_x * y - g_y * x, g_x * x + g_y * y))


@dataclass(frozen=True)
class Energy:
    """Kinetic energy that the grains gain up to its largest, and the work of gravity on them.

    Attributes:
        gained, work: per mass, over |g| times the height of the grains.
    """

    gained: float
    work: float

    @property
    def share(self) -> float:
        """Part of the work that becomes kinetic energy."""
        return self.gained / self.work


def fall_of(flow: Flow, body: Body) -> Fall | None:
    """The fall of the side that accelerates most; None if no side does so in a straight line."""
    found = [f for name in INWARD if (f := _fall(flow, body, name)) is not None]
    return max(found, key=lambda fall: fall.inward, default=None)


def _fall(flow: Flow, body: Body, side: str) -> Fall | None:
    velocity, g = body.sides[side], math.hypot(*flow.gravity)
    speed = velocity @ np.array(INWARD[side], float)
    known = np.isfinite(speed)
    t, velocity, speed = body.t[known], velocity[known], speed[known]
    if speed.size < FEWEST_FRAMES:
        return None
    largest = int(np.argmax(speed))
    slow = np.flatnonzero(speed[:largest] < RISES[0] * speed[largest])
    start = int(slow[-1]) if slow.size else 0
    stop = start + int(np.argmax(speed[start:] > RISES[1] * speed[largest])) + 1
    if not speed[largest] > 0 or stop - start < FEWEST_FRAMES:
        return None
    t, velocity = t[start:stop] - t[start], velocity[start:stop]
    matrix = np.stack([np.ones_like(t), t], axis=1)
    line = np.linalg.lstsq(matrix, velocity, rcond=None)[0]
    rest = np.sqrt(((velocity - matrix @ line) ** 2).sum(axis=0) / (t.size - 2))
    if not rest.max() < STRAIGHT * speed[largest]:
        return None
    error = float(rest.max() / math.sqrt(((t - t.mean()) ** 2).sum())) / g
    a_x, a_y = (float(a) / g for a in line[1])
    d_x, d_y = INWARD[side]
    pull = (flow.gravity[0] * d_x + flow.gravity[1] * d_y) / g
    return Fall(side, (a_x, a_y), error, a_x * d_x + a_y * d_y, pull)


def energy_of(flow: Flow, body: Body, height: float) -> Energy | None:
    """The energy that the grains gain; None if they gain little, or other grains are seen later."""
    last = int(np.argmax(body.energy))
    if last < 2 or not body.energy[0] < GROWS * body.energy[last]:
        return None
    if not SAME_GRAINS < body.area[last] / body.area[0] < 1 / SAME_GRAINS:
        return None
    power, step = body.velocity[: last + 1] @ np.array(flow.gravity), np.diff(body.t[: last + 1])
    work = float(((power[1:] + power[:-1]) / 2) @ step)
    # The noise of the power cancels in no second difference, and its change in time nearly does.
    noise = float(np.sqrt(np.mean(np.diff(power, 2) ** 2) / 6)) if power.size > 2 else 0.0
    if not noise * math.sqrt(float((step**2).sum())) < SURE_WORK * abs(work):
        return None
    unit = math.hypot(*flow.gravity) * height
    return Energy(float(body.energy[last] - body.energy[0]) / unit, work / unit)


def slender(body: Body, gravity: tuple[float, float]) -> tuple[float, Float64]:
    """Height over width of the body in the first frame, and its height in time over the first.

    Along the axis of the file closest to gravity.
    """
    along = int(abs(gravity[1]) >= abs(gravity[0]))
    height, width = body.extent[:, along], body.extent[:, 1 - along]
    return float(height[0] / width[0]), height / height[0]
