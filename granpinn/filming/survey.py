"""What a film shows before any measurement: motion, light and sharpness from frame to frame.

Every frame is compared with the one before it. `judged` finds from this the release of the grains,
and the frames over which no velocity may be measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pandas as pd

from granpinn.arrays import Bool, Float64
from granpinn.filming.frames import ImageSequence, Picture
from granpinn.filming.tracking import LARGEST, features, follow, side_of_window
from granpinn.importers.vectors import DataFileError

SAMPLES = 400  # features of a frame
RENEWED = 4  # frames after which new features are searched
AROUND = 4  # frames on each side that light and shifts are compared with
STILL = 0.12  # px, motion of the fast grains that noise may make
NOISE = 1.6  # least motion of grains over that of noise
STARTING = 12  # frames that show the release, up to half of the largest motion
FAST, SLOW = 0.95, 0.1  # quantiles of the motion
REPEATED, LOST = 0.3, 1.6  # motion over that before and after it
SHIFT = 0.4  # px, motion of the slowest features that is none of the grains
FLICKER = 0.05  # change of the light from one frame to the next
BLURRED = 0.5  # sharpness over that of the film
FOUND = 0.5  # share of the features that can be followed
SHOWN = 6  # frame numbers in a message


@dataclass
class Survey:
    """Of every frame k [T]; motion is that from frame k - 1 to frame k, NaN where not known.

    Attributes:
        fast, slow: quantiles of the motion, px. found: share of the features that were followed.
        light: mean grey level. sharp: mean square of the second differences.
        broken: why a frame cannot be used.
    """

    fast: Float64
    slow: Float64
    found: Float64
    light: Float64
    sharp: Float64
    broken: dict[int, str] = field(default_factory=dict)


@dataclass
class UsableFrames:
    """The frames that can be measured, the release, and the faults of the film.

    Attributes:
        whole: frames that can be used [T].
        joined: whether a velocity may be measured across frames k - 1 and k [T].
        release: the time of the release, in frames; None: the grains move from the first frame on.
        acceleration: of the fast grains after it, px/frame^2.
        said: a sentence for each fault.
    """

    whole: Bool
    joined: Bool
    release: float | None
    acceleration: float
    said: list[str]


def survey(frames: ImageSequence, grains: Callable[[Picture], Picture], grain: float) -> Survey:
    """Looks at every frame once.

    Args:
        grains: a picture to its pixels that show grains, not 0 [rows, columns].
        grain: diameter, px.
    """
    found = Survey(*np.full((5, frames.count), np.nan))
    before: Picture | None = None
    places = np.zeros((0, 2))
    for k, (picture, why) in enumerate(frames):
        if picture is None:
            found.broken[k] = why
            before, places = None, places[:0]
            continue
        found.light[k] = picture[::2, ::2].mean()
        found.sharp[k] = np.mean(np.diff(picture[::2].astype(np.float32), 2) ** 2)
        if before is not None:
            if k % RENEWED == 0 or len(places) < SAMPLES // 2:
                places = features(before, grain, grains(before), SAMPLES)
            moved, again = follow(before, picture, places, side_of_window(grain))
            found.found[k] = again.sum() / max(len(places), 1)
            if again.any():
                size = np.hypot(*moved[again].T)
                found.slow[k], found.fast[k] = np.quantile(size, (SLOW, FAST))
            places = (places + moved)[again]
        before = picture
    return found


def judged(film: Survey, frames: ImageSequence) -> UsableFrames:
    """Faults of the film, and the release.

    Raises:
        DataFileError: the film shows no texture, or the grains move too far between frames.
    """
    whole = np.isfinite(film.light)
    said = [f"{frames.name(k)} is left out: {why}" for k, why in [*film.broken.items()][:SHOWN]]
    if whole.sum() < frames.count / 2:
        raise DataFileError(
            f"at least half of the frames must be readable, got {int(whole.sum())} of "
            f"{frames.count}: {said[0]}"
        )
    _require_motion(film)
    before, after = np.roll(film.fast, 1), np.roll(film.fast, -1)
    moving = np.minimum(before, after) > 4 * STILL
    repeated = moving & (film.fast < REPEATED * np.minimum(before, after))
    lost = moving & (film.fast > LOST * np.maximum(before, after))
    shifted = (film.slow > SHIFT) & (film.slow > 3 * _usual(film.slow) + SHIFT)
    blurred = film.sharp < BLURRED * np.nanmedian(film.sharp)
    level = _usual(film.light)
    flicker = np.abs(film.light / level - 1) > FLICKER
    for fault, what in (
        (repeated, "shows the same picture as the frame before it: frames are repeated"),
        (lost & ~shifted, "comes after a gap: frames are lost, and times after it are too early"),
        (shifted, "is shifted as a whole: the camera moved"),
        (blurred, "is blurred: expose it for a shorter time, or focus the camera"),
        (flicker, "has another brightness than the frames around it: the light flickers"),
    ):
        if fault.any():
            said.append(f"{_numbers(fault)} {what}; no velocity is measured across it")
    joined = whole & ~(repeated | lost | shifted)
    joined[1:] &= whole[:-1]
    joined[0] = False
    return UsableFrames(whole & ~blurred & ~flicker, joined, *_release(film.fast), said)


def _require_motion(film: Survey) -> None:
    """Refuses films without texture, without motion, or with too much of it."""
    lost = film.found < FOUND
    if lost.mean() > FOUND / 5:
        raise DataFileError(
            "the grains must have texture and move by a few px from frame to frame, but in "
            f"{lost.sum()} of {lost.size} frames, such as {_numbers(lost)}, less than half of the "
            "features are found again: film at a higher frame rate, light the grains from the "
            "side, or come nearer with the camera"
        )
    fast = float(np.nanquantile(film.fast, FAST))
    if fast > LARGEST:
        raise DataFileError(
            f"grains must move by at most {LARGEST:g} px from frame to frame, got {fast:.3g} px: "
            "film at a higher frame rate, or from farther away"
        )
    if fast < STILL:
        raise DataFileError(
            f"the grains must move, got at most {fast:.2g} px from frame to frame: give the frames "
            "of the flow, or every tenth frame with a tenth of the frame rate"
        )


def _usual(values: Float64) -> Float64:
    """Median of each value and the AROUND ones before and after it."""
    around = pd.Series(values).rolling(2 * AROUND + 1, center=True, min_periods=1)
    return np.asarray(around.median())


def _release(fast: Float64) -> tuple[float | None, float]:
    """The time at which the line through the first motions is zero, in frames, and its slope.

    The motion from frame k - 1 to k is that of the time k - 1/2.
    """
    noise = float(np.nanquantile(fast, 0.02))  # before the release there is nothing else
    known = np.nan_to_num(fast)
    moves = known > max(STILL, NOISE * noise)
    moving = np.flatnonzero(moves[:-2] & moves[1:-1] & moves[2:])
    if moving.size == 0 or moving[0] <= 1:
        return None, math.nan
    first = known[moving[0] : moving[0] + STARTING]
    steady = int(np.argmax(np.append(first > known.max() / 2, True)))
    k = moving[0] + np.flatnonzero(first[: max(steady, 3)] > noise)
    slope, level = np.polyfit(k - 0.5, np.sqrt(known[k] ** 2 - noise**2), 1)
    start = -level / slope if slope > 0 else moving[0] - 1.0
    return float(np.clip(start, moving[0] - STARTING, moving[0])), float(slope)


def _numbers(faults: npt.NDArray[np.bool_]) -> str:
    """frames 3, 7, 12 and 9 more."""
    numbers = np.flatnonzero(faults)
    more = f" and {numbers.size - SHOWN} more" if numbers.size > SHOWN else ""
    return f"frame {', '.join(map(str, numbers[:SHOWN]))}{more}"
