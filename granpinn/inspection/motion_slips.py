"""Slips of unit, sign and order of u, v, t, x and y: these must fit each other in any unit.

The gradients of u and v, and the motion of c, must fit u and v (conservation.py). The bounds:

- v_y and -u_x differ by a factor of 1.43 at most if noise leaves them correlated (CORRELATED); 1.6
  is improbable.
- The center of mass of c moves 0.7 to 1.05 times as far as the mean velocity takes it where
  vectors at fast edges are missing. 5 is improbable; 1.6 is, where nearly all grains have vectors
  and x and y agree. More than 10 is impossible.
"""

from __future__ import annotations

import math

from granpinn.inspection.conservation import Center, Volume
from granpinn.inspection.wording import about
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, Slip

GRADIENTS_DIFFER, CENTER_DIFFERS, NO_ERROR = 1.6, 5.0, 10.0
# Both directions agree within the second factor, and so many grains have vectors.
BOTH_DIFFER, AGREE, COVERED = 1.6, 1.3, 0.8


def motion_slips(volume: Volume, center: Center, covered: float) -> list[Slip]:
    """Slips of sign, else of unit.

    Args:
        covered: share of the grains that have vectors.
    """
    return _orientation(volume, center) or _factors(volume, center, covered)


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
        return [Slip(IMPOSSIBLE, f"{wrong} (or x or y) has the wrong sign")]
    where = "x and y" if in_x is in_y else "y" if in_x is not False else "x"
    cause = {
        "x": "u (or x) has the wrong sign",
        "y": "v (or y) is upside down",
        "x and y": "u and v have the wrong sign, or time runs backward",
    }[where]
    against = f"the center of mass moves against the velocity of the grains in {where}"
    return [Slip(IMPOSSIBLE, f"{against}: {cause}")]


def _factors(volume: Volume, center: Center, covered: float) -> list[Slip]:
    """Components, times and places in units that do not fit together."""
    n = {axis: r for axis, r in zip("xy", center.ratio, strict=True) if r is not None}
    far = {axis: r for axis, r in n.items() if beyond(r, CENTER_DIFFERS)}
    agree = len(n) == 2 and covered > COVERED and not beyond(n["x"] / n["y"], AGREE)
    if not far and agree and all(beyond(r, BOTH_DIFFER) for r in n.values()):
        far = n
    if far and (len(n) == 1 or not beyond(n["x"] / n["y"], GRADIENTS_DIFFER)):
        ratio = math.exp(sum(map(math.log, n.values())) / len(n))
        parts = "u and v, t, or x and y"
    elif far:
        axis, ratio = max(far.items(), key=lambda item: abs(math.log(item[1])))
        parts = {"x": "u or x", "y": "v or y"}[axis]
    elif volume.ratio is not None and beyond(volume.ratio, GRADIENTS_DIFFER):
        return [
            Slip(
                _severity(volume.ratio),
                f"v_y is {about(volume.ratio)} -u_x, and they are equal if grains keep their "
                "volume: x and y, or u and v, are not in the same unit",
            )
        ]
    else:
        return []
    frames = "" if beyond(ratio, CENTER_DIFFERS) else ", and whether frames are doubled or lost"
    return [
        Slip(
            _severity(ratio),
            f"the velocity integrated over time is {about(ratio)} the way of the center of "
            f"mass: check the units of {parts}{frames}",
        )
    ]


def beyond(ratio: float, factor: float) -> bool:
    """Whether a ratio differs from 1 by more than a factor."""
    return not 1 / factor <= ratio <= factor


def _severity(ratio: float) -> str:
    return IMPOSSIBLE if beyond(ratio, NO_ERROR) else IMPROBABLE
