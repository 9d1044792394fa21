"""Slips of scale, frame rate and gravity, from the fall and the energy of the grains (fall.py).

All of these leave u and v in agreement with the motion of the grains, and only gravity shows them:
a scale wrong by a factor s changes all accelerations by s, a frame rate wrong by r changes them by
r^2. The bounds have these margins:

- A side falls with gravity at most. 1.2 g is improbable, 1.8 g impossible.
- Grains that nothing carries fall along gravity. The sideways push of the grains below turns the
  fall by 1.6 degrees in columns three times as high as wide; 3 degrees are improbable.
- Kinetic energy is at most the work of gravity. It is 0.37 to 0.69 of it in collapses of columns
  of 0.5 to 10 times their width, from simulations of mu(I) and of grains with any friction. 1.1 is
  improbable, 1.5 impossible; less than 0.15 is improbable in a column that spreads.
- The top of a column that is four times as high as wide falls with 0.87 g or more; 0.7 g is
  improbable.

Error bars of three standard errors count on top. Walls that move give energy: the energy is left
out if the file states them.
"""

from __future__ import annotations

import math

from granpinn.data import Flow
from granpinn.inspection.body import Body
from granpinn.inspection.fall import Energy, Fall, energy_of, fall_of, slender
from granpinn.inspection.wording import digits
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, Slip

SURE = 3.0  # standard errors
FAST, TOO_FAST = 1.2, 1.8  # inward acceleration over the pull of gravity
ASIDE = 0.5  # of |g|: an inward acceleration that only gravity gives
FREE, TILT = 0.9, 3.0  # least acceleration of a free fall over |g|; degrees
FASTER = 1.05  # size of a free fall over |g|, above which a scale is wrong
SLENDER, SLOW = 4.0, 0.7
GAINS, GAINS_TOO_MUCH, GAINS_LITTLE = 1.1, 1.5, 0.15
COLUMN, SPREADS = 1.0, 0.8  # height over width at first; height at last over that at first
RISE = 0.01  # of the height of the grains: less work against gravity shows nothing


def gravity_slips(flow: Flow, body: Body, height: float, closed: bool) -> list[Slip]:
    """The most certain slip of scale, frame rate or gravity, or none.

    Args:
        height: of all places that held grains.
        closed: whether no grains cross the edges of the grid.
    """
    if flow.steady or not (closed or flow.periodic):
        return []
    fall = fall_of(flow, body) if closed else None
    driven = flow.walls is not None and flow.walls.u is not None
    energy = None if driven else energy_of(flow, body, height)
    aspect, heights = slender(body, flow.gravity)
    column = closed and aspect >= COLUMN and heights[-1] < SPREADS
    rules = (_direction(flow, fall), _size(fall), _gain(energy))
    slow = (_slow(fall, aspect), _loss(energy)) if column else ()
    found = [slip for slip in (*rules, *slow, _tilt(flow, fall)) if slip is not None]
    return found[:1]


def _direction(flow: Flow, fall: Fall | None) -> Slip | None:
    """Grains that fall where gravity does not pull."""
    if fall is None or fall.pull > ASIDE or fall.inward - SURE * fall.error < ASIDE:
        return None
    turned = abs(fall.tilt(flow.gravity))
    picture = "upside down" if turned > 135 else "turned by a quarter"
    return Slip(
        IMPOSSIBLE,
        f"the {fall.side} of the grains falls with {digits(fall.size)} times gravity, {turned:.0f} "
        f"degrees away from it: the picture is {picture}, or gravity has a wrong direction or "
        "sign (convert: --flip-y, --tilt)",
    )


def _size(fall: Fall | None) -> Slip | None:
    """Grains that fall faster than freely."""
    if fall is None or not fall.pull > ASIDE:
        return None
    ratio = (fall.inward - SURE * fall.error) / fall.pull
    if ratio < FAST:
        return None
    factor = fall.inward / fall.pull
    return Slip(
        IMPOSSIBLE if ratio > TOO_FAST else IMPROBABLE,
        f"the {fall.side} of the grains falls with {digits(factor)} times the gravity of the file, "
        f"and nothing falls faster than freely: {_remedy(factor, 'at least')}",
    )


def _slow(fall: Fall | None, aspect: float) -> Slip | None:
    """The top of a slender column that falls too slowly."""
    if fall is None or aspect < SLENDER or not fall.pull > ASIDE:
        return None
    if fall.inward + SURE * fall.error > SLOW * fall.pull:
        return None
    factor = fall.inward / fall.pull
    return Slip(
        IMPROBABLE,
        f"the {fall.side} of a column {aspect:.2g} times as high as wide falls with "
        f"{digits(factor)} times the gravity of the file, and nearly freely if nothing holds it: "
        f"{_remedy(factor, 'about')}",
    )


def _gain(energy: Energy | None) -> Slip | None:
    """Grains that gain more energy than gravity gives."""
    if energy is None:
        return None
    if energy.work < 0:
        if energy.work > -RISE and energy.gained < RISE:
            return None
        return Slip(
            IMPROBABLE,
            "the grains gain speed while they rise against gravity, and without moving walls they "
            "can only fall: check the signs of gravity, y and v, and the order of the frames",
        )
    if energy.share < GAINS:
        return None
    return Slip(
        IMPOSSIBLE if energy.share > GAINS_TOO_MUCH else IMPROBABLE,
        f"the grains gain {digits(energy.share)} times the energy that gravity gives them, and "
        "friction leaves less than all of it: the scale is too large (the share grows with it), "
        "the frame rate is too high (with its square), or gravity is too small",
    )


def _loss(energy: Energy | None) -> Slip | None:
    """A column that falls and hardly moves."""
    if energy is None or not 0 < energy.share < GAINS_LITTLE:
        return None
    return Slip(
        IMPROBABLE,
        f"the falling column gains {digits(energy.share)} of the energy that gravity gives it, and "
        "collapses of columns gain a third or more: the scale is too small (the share grows with "
        "it), the frame rate is too low (with its square), gravity is too large, or something "
        "held the grains",
    )


def _tilt(flow: Flow, fall: Fall | None) -> Slip | None:
    """Grains that fall freely, but not along gravity."""
    if fall is None or not fall.pull > ASIDE or fall.size < FREE:
        return None
    tilt = fall.tilt(flow.gravity)
    if abs(tilt) - SURE * math.degrees(fall.error / fall.size) < TILT:
        return None
    text = (
        f"the freely falling {fall.side} of the grains accelerates {abs(tilt):.1f} degrees "
        f"{'counter-' if tilt > 0 else ''}clockwise of gravity"
    )
    turn = "check the direction of gravity (convert: --tilt)"
    if fall.size - SURE * fall.error > FASTER:  # no direction of gravity makes it larger
        more = fall.size - 1
        text += (
            f" and {more:.0%} faster than gravity: the scale is about {more:.0%} too large, or the "
            f"frame rate {more / 2:.0%} too high, which no tilt explains; then {turn}"
        )
    else:
        text += f": {turn}"
    return Slip(IMPROBABLE, text)


def _remedy(factor: float, bound: str) -> str:
    """What explains an acceleration that is wrong by a factor, exactly so or by a bound."""
    fast = factor > 1
    size = max(factor, 1 / factor)
    whole, root = (f"{bound} {digits(x)} times too" for x in (size, math.sqrt(size)))
    if fast:
        return f"the scale is {whole} large, the frame rate {root} high, or gravity {whole} small"
    return f"the scale is {whole} small, the frame rate {root} low, or gravity {whole} large"
