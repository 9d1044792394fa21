r"""Gravity, as the grains show it: it bounds their acceleration, energy and speed.

A wrong scale, frame rate or gravity leaves u and v in agreement with the motion of the grains. Only
gravity shows it: a scale wrong by a factor s changes all accelerations by s, a frame rate wrong by
r changes them by r^2.

- **Fall.** Dry grains push and do not pull. So a free side of the body moves inward, into the
  body, with the acceleration of gravity at most, and with all of it where nothing carries it: at
  the top of a slender column. The mean velocity of the layer there against time has this slope. It
  is within 0.4 % and 0.2 degrees of gravity in columns six times as high as wide, and the mean over
  hundreds of vectors hides the noise (bench/studies/slips). 1.05 g is improbable, 1.8 g impossible.
  The top of a column that is four times as high as wide falls with 0.87 g or more; 0.7 g is
  improbable. The sideways push of the grains below turns the fall by 1.6 degrees in columns three
  times as high as wide; 3 degrees are improbable.
- **Energy.** Friction takes energy and no wall at rest gives any: the kinetic energy that the
  grains gain is a part of the work of gravity on them, $\int \rho\, g \cdot v$. With lengths or
  velocities in a wrong unit both sides change by different powers. 1.1 is improbable, 1.5
  impossible. Walls that move give energy: it is left out if the file states them.
- **Speed.** Grains that fall a height H reach sqrt(2 |g| H). Those at a front are pushed, and reach
  sqrt(4 |g| H) without friction (the dam break). Grains that enter the grid may have fallen
  farther: a chute may be far longer than the grid, but not fall from 10^4 times its height.

Error bars of three standard errors count on top.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.data import Flow
from granpinn.estimates.body import INWARD, Body
from granpinn.inspection import Inspection, about, digits
from granpinn.results.record import IMPOSSIBLE, IMPROBABLE, Check, Reason, Record

# A fall is measured while the speed of a side rises from the first to the second part of its
# largest, in so many frames; the rest of a straight line is at most this part of it.
RISES = (0.1, 0.7)
FEWEST_FRAMES = 4
STRAIGHT = 0.1
# The energy grows if it was less than this part of its largest at first; as many grains are seen.
GROWS, SAME_GRAINS = 0.7, 0.6
SURE_WORK = 0.2  # largest standard error of the work of gravity, relative
STANDARD_ERRORS = 3.0
# Inward acceleration over the pull of gravity; sound flows: up to 1.002 (bench/studies/slips).
FAST, TOO_FAST = 1.05, 1.8
ASIDE = 0.5  # of |g|: an inward acceleration that only gravity gives
SHOWN = 0.85  # of |g|: an acceleration that is called a free fall
FREE, TILT = 0.9, 3.0  # least acceleration of a free fall over |g|; degrees
TURN = "check the direction of gravity (convert: --tilt)"
SLENDER, SLOW = 4.0, 0.7  # height over width; acceleration over the pull of gravity
SPREADS = 0.8  # height of a column at last over that at first
GAINS, GAINS_TOO_MUCH = 1.1, 1.5
RISE = 0.01  # of the height of the grains: less work against gravity shows nothing
CLOSED_FAST, OPEN_FAST = (1.5, 5.0), (10.0, 100.0)  # speed over that of a free fall
FASTEST = 0.99  # quantile of the speeds


@dataclass(frozen=True)
class Fall:
    """The fastest inward acceleration of a side.

    Attributes:
        side: its name in the axes of the file: left side, right side, bottom or top.
        acceleration: (a_x, a_y) over |g|.
        error: standard error of a component.
        inward: the inward component.
        pull: the inward component of gravity, -1 to 1.
        tilt: degrees from gravity to the acceleration, counter-clockwise.
    """

    side: str
    acceleration: tuple[float, float]
    error: float
    inward: float
    pull: float
    tilt: float

    @property
    def size(self) -> float:
        """Of the acceleration, over |g|."""
        return math.hypot(*self.acceleration)

    @property
    def turned(self) -> str:
        """Which way a free fall is turned, in words; nothing if it is along gravity."""
        error = STANDARD_ERRORS * math.degrees(self.error / self.size)
        if not self.pull > ASIDE or self.size < FREE or abs(self.tilt) - error < TILT:
            return ""
        turn = "counter-" if self.tilt > 0 else ""
        return f"accelerates {abs(self.tilt):.1f} degrees {turn}clockwise of gravity"


@dataclass(frozen=True)
class Gravity(Record):
    """
    Attributes:
        fall: of the side that accelerates most.
        energy: kinetic energy that the grains gain up to its largest, and the work of gravity on
            them; per mass, over |g| times the height of the grains.
        speed: the largest over that of a free fall through the height of all grains; None without
            vectors.
        aspect, shrinks: height over width of the body in the first frame, and its height in the
            last frame over that in the first.
    """

    title = "gravity"

    fall: Fall | None
    energy: tuple[float, float] | None
    speed: float | None
    aspect: float
    shrinks: float

    @property
    def words(self) -> str:
        fall = self.fall
        if fall is None:
            return "not checked: no side of the grains accelerates evenly, or there are few vectors"
        if fall.pull > ASIDE and fall.size >= SHOWN:
            return (
                f"the {fall.side} of the grains falls with {fall.size:.3f} +- {fall.error:.1g} g, "
                f"{fall.tilt:+.1f} degrees from it"
            )
        return f"not checked: nothing falls freely (largest acceleration {fall.size:.2f} g)"

    def reasons(self, of: Inspection) -> list[Reason]:
        """The most certain slip of scale, frame rate, gravity or speed, or none."""
        if of.filmed.source is not None:  # of another force
            return []
        mass = of["mass"]
        fall = self.fall if mass.closed else None
        rules = _direction(fall), _size(fall), _gain(self.energy), self._slow(fall), _tilt(fall)
        return [slip for slip in (*rules, self._speed(mass.closed)) if slip is not None][:1]

    def _slow(self, fall: Fall | None) -> Reason | None:
        """The top of a slender column that falls too slowly."""
        if fall is None or self.aspect < SLENDER or self.shrinks >= SPREADS or fall.pull <= ASIDE:
            return None
        if fall.inward + STANDARD_ERRORS * fall.error > SLOW * fall.pull:
            return None
        factor = fall.inward / fall.pull
        return Reason(
            IMPROBABLE,
            f"the {fall.side} of a column {self.aspect:.2g} times as high as wide falls with "
            f"{digits(factor)} times the gravity of the file, and nearly freely if nothing holds "
            f"it: {_remedy(factor, 'about')}",
        )

    def _speed(self, closed: bool) -> Reason | None:
        """Speeds that no free fall reaches."""
        fast, too_fast = CLOSED_FAST if closed else OPEN_FAST
        if self.speed is None or not self.speed > fast:
            return None
        return Reason(
            IMPOSSIBLE if self.speed > too_fast else IMPROBABLE,
            f"grains move at {about(self.speed)} the speed of a free fall through the height of "
            "all grains: check the units of u and v, x and y, and gravity",
        )


def _direction(fall: Fall | None) -> Reason | None:
    """Grains that fall where gravity does not pull."""
    if fall is None or fall.pull > ASIDE or fall.inward - STANDARD_ERRORS * fall.error < ASIDE:
        return None
    turned = abs(fall.tilt)
    picture = "upside down" if turned > 135 else "turned by a quarter"
    return Reason(
        IMPOSSIBLE,
        f"the {fall.side} of the grains falls with {digits(fall.size)} times gravity, {turned:.0f} "
        f"degrees away from it: the picture is {picture}, or gravity has a wrong direction or "
        "sign (convert: --flip-y, --tilt)",
    )


def _size(fall: Fall | None) -> Reason | None:
    """Grains that fall faster than freely."""
    if fall is None or not fall.pull > ASIDE:
        return None
    ratio = (fall.inward - STANDARD_ERRORS * fall.error) / fall.pull
    if ratio < FAST:
        return None
    factor = fall.inward / fall.pull
    text = (
        f"the {fall.side} of the grains falls with {_times(factor)} times the gravity of the file, "
        f"and nothing falls faster than freely: {_remedy(factor, 'at least')}"
    )
    if fall.turned:
        text += f"; then {TURN}, as it also {fall.turned}"
    return Reason(IMPOSSIBLE if ratio > TOO_FAST else IMPROBABLE, text)


def _gain(energy: tuple[float, float] | None) -> Reason | None:
    """Grains that gain more energy than gravity gives."""
    if energy is None:
        return None
    gained, work = energy
    if work < 0:
        if work > -RISE and gained < RISE:
            return None
        return Reason(
            IMPROBABLE,
            "the grains gain speed while they rise against gravity, and without moving walls they "
            "can only fall: check the signs of gravity, y and v, and the order of the frames",
        )
    if gained / work < GAINS:
        return None
    return Reason(
        IMPOSSIBLE if gained / work > GAINS_TOO_MUCH else IMPROBABLE,
        f"the grains gain {digits(gained / work)} times the energy that gravity gives them, and "
        "friction leaves less than all of it: the scale is too large (the share grows with it), "
        "the frame rate is too high (with its square), or gravity is too small",
    )


def _tilt(fall: Fall | None) -> Reason | None:
    """Grains that fall freely, but not along gravity."""
    if fall is None or not fall.turned:
        return None
    return Reason(IMPROBABLE, f"the freely falling {fall.side} of the grains {fall.turned}: {TURN}")


def _remedy(factor: float, bound: str) -> str:
    """What explains an acceleration that is wrong by a factor, exactly so or by a bound."""
    fast = factor > 1
    size = max(factor, 1 / factor)
    whole, root = (f"{bound} {_times(x)} times too" for x in (size, math.sqrt(size)))
    if fast:
        return f"the scale is {whole} large, the frame rate {root} high, or gravity {whole} small"
    return f"the scale is {whole} small, the frame rate {root} low, or gravity {whole} large"


def make(inspection: Inspection) -> Gravity:
    flow, body, height = inspection.filmed, inspection.body, inspection.height
    mass = inspection["mass"]
    speeds, free_fall = inspection.speeds, math.sqrt(2 * math.hypot(*flow.gravity) * height)
    driven = flow.walls is not None and flow.walls.u is not None
    measured = (mass.closed or flow.periodic) and not driven and not flow.steady
    aspect, shrinks = slender(body)
    return Gravity(
        fall=None if flow.steady else fall_of(flow, body),
        energy=energy_of(flow, body, height) if measured else None,
        speed=float(np.quantile(speeds, FASTEST)) / free_fall if speeds.size else None,
        aspect=aspect,
        shrinks=shrinks,
    )


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
    g_x, g_y = flow.gravity
    tilt = math.degrees(math.atan2(g_x * a_y - g_y * a_x, g_x * a_x + g_y * a_y))
    return Fall(side, (a_x, a_y), error, a_x * d_x + a_y * d_y, (g_x * d_x + g_y * d_y) / g, tilt)


def energy_of(flow: Flow, body: Body, height: float) -> tuple[float, float] | None:
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
    return float(body.energy[last] - body.energy[0]) / unit, work / unit


def slender(body: Body) -> tuple[float, float]:
    """Height over width of the body in the first frame, and its last height over the first."""
    width, height = body.extent.T
    return float(height[0] / width[0]), float(height[-1] / height[0])


CHECK = Check("gravity", Gravity, make, seconds=0.06, explains=True)


def _times(factor: float) -> str:
    """A factor with two digits, with three where it is near 1."""
    return f"{factor:.3g}" if factor < 2 else digits(factor)
