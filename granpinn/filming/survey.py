"""What a film shows before any measurement: motion, light and sharpness from frame to frame.

Every frame is compared with the one before it. This shows the faults of the film, the frames over
which no velocity may be measured, and the release of the grains.
"""

from __future__ import annotations

import math
from textwrap import shorten
from typing import Any

import numpy as np
import pandas as pd

from granpinn.filming.frames import ImageSequence, Picture
from granpinn.filming.segmentation import Segmentation
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
MOST_LOST = 0.1  # of the frames
COLUMNS = ("fast", "slow", "found", "light", "sharp", "why")


def survey(frames: ImageSequence, segmentation: Segmentation) -> pd.DataFrame:
    """Looks at every frame once.

    Returns:
        A row for every frame k. fast, slow: quantiles of the motion from frame k - 1, px. found:
        share of the features that were followed. light: mean grey level. sharp: mean square of the
        second differences. NaN where not known. why: why a frame cannot be used.
    """
    grain = segmentation.grain
    rows: list[dict[str, Any]] = []
    before: Picture | None = None
    places = np.zeros((0, 2))
    for k, (picture, why) in enumerate(frames):
        row: dict[str, Any] = {"why": why}
        if picture is not None:
            row["light"] = picture[::2, ::2].mean()
            row["sharp"] = np.mean(np.diff(picture[::2].astype(np.float32), 2) ** 2)
        if picture is None or before is None:
            places = places[:0]
        else:
            if k % RENEWED == 0 or len(places) < SAMPLES // 2:
                places = features(before, grain, segmentation.grains(before), SAMPLES)
            moved, again = follow(before, picture, places, side_of_window(grain))
            row["found"] = again.sum() / max(len(places), 1)
            if again.any():
                row["slow"], row["fast"] = np.quantile(np.hypot(*moved[again].T), (SLOW, FAST))
            places = (places + moved)[again]
        rows.append(row)
        before = picture
    return pd.DataFrame(rows, columns=[*COLUMNS])


def faults(film: pd.DataFrame) -> list[str]:
    """A sentence for each fault of the film.

    `film` gets two columns: whether a frame can be used (`whole`), and whether a velocity may be
    measured across it and the frame before it (`joined`).

    Raises:
        DataFileError: the film shows no texture, no motion or too much of it.
    """
    readable, fast = film.light.notna(), film.fast
    said = [f"frame {k} is left out: {why}" for k, why in film.why[~readable].items()]
    lost = (film.found < FOUND) | (fast > LARGEST)
    if lost.mean() > MOST_LOST:
        raise DataFileError(
            f"the grains must have texture and move by at most {LARGEST:g} px from frame to frame, "
            f"but in {_numbers(lost)} they move farther, or less than half of the features are "
            "found again: film at a higher frame rate, light the grains from the side, or change "
            "the distance of the camera"
        )
    if fast.quantile(FAST) < STILL:
        raise DataFileError(
            f"the grains must move, got at most {fast.max():.2g} px from frame to frame: give the "
            "frames of the flow, or every tenth frame with a tenth of the frame rate"
        )
    usual = film[["slow", "light"]].rolling(2 * AROUND + 1, center=True, min_periods=1).median()
    before, after = fast.shift(1), fast.shift(-1)
    moving = np.minimum(before, after) > 4 * STILL
    repeated = moving & (fast < REPEATED * np.minimum(before, after))
    shifted = (film.slow > SHIFT) & (film.slow > 3 * usual.slow + SHIFT)
    gap = moving & (fast > LOST * np.maximum(before, after)) & ~shifted
    blurred = film.sharp < BLURRED * film.sharp.median()
    flicker = (film.light / usual.light - 1).abs() > FLICKER
    for fault, what in (
        (repeated, "shows the same picture as the frame before it: frames are repeated"),
        (gap, "comes after a gap: frames are lost, and times after it are too early"),
        (shifted, "is shifted as a whole: the camera moved"),
        (blurred, "is blurred: expose it for a shorter time, or focus the camera"),
        (flicker, "has another brightness than the frames around it: the light flickers"),
    ):
        if fault.any():
            said.append(f"{_numbers(fault)} {what}; no velocity is measured across it")
    film["joined"] = readable & readable.shift(fill_value=False) & ~(repeated | gap | shifted)
    film["whole"] = readable & ~blurred & ~flicker
    return said


def release(film: pd.DataFrame) -> tuple[float | None, float]:
    """The time of the release, in frames, and the acceleration of the fast grains, px/frame^2.

    It is the time at which the line through the first motions is zero; None: the grains move from
    the first frame on. The motion from frame k - 1 to k is that of the time k - 1/2.
    """
    noise = film.fast.quantile(0.02)  # before the release there is nothing else
    known = film.fast.fillna(0.0).to_numpy()
    moves = known > max(STILL, NOISE * noise)
    first = int(np.argmax(moves[:-2] & moves[1:-1] & moves[2:]))  # 0: never
    if first <= 1:
        return None, math.nan
    k = np.arange(first, min(first + STARTING, known.size))
    k = k[(known[k] > noise) & ((known[k] < known.max() / 2) | (k < first + 3))]
    slope, level = np.polyfit(k - 0.5, np.sqrt(known[k] ** 2 - noise**2), 1)
    start = -level / slope if slope > 0 else first - 1.0
    return float(np.clip(start, first - STARTING, first)), float(slope)


def _numbers(faults: pd.Series) -> str:
    """Frame 3, 7, 12, ..."""
    return "frame " + shorten(", ".join(map(str, np.flatnonzero(faults))), 40, placeholder=" ...")
