"""The time of every pair of images, where the files name them: images 1 and 3, 2 and 4, ...

The images of a film follow each other evenly. With the numbers a and b of the two images, and the
usual step s of a from one file to the next, a pair lies at ((a + b) / 2 - start) / s frames, and
(b - a) / s frames are between its images. Pairs that share no image and have none between their own
two may be double frames, of which the names do not show the time.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers import units
from granpinn.importers.frame import PAIR_FRAMES
from granpinn.importers.vectors import DataFileError, VectorFields

IMAGES = "images"  # the fact of a file: numbers of its two images
SAID = "pairs_of_images"  # the fact of a series: a sentence about them
_MAX_NUMBER = 10**9


def with_pair_times(files: list[Path], parts: list[VectorFields]) -> list[VectorFields]:
    """The frames of a series with the times of their pairs, velocities per pair as in the first.

    Raises:
        DataFileError: velocities in m/s were made with one time for pairs of several.
    """
    named = [part.facts.get(IMAGES, "").split() for part in parts]
    if not all(named) or any(max(map(len, pair)) > len(str(_MAX_NUMBER)) for pair in named):
        return parts
    a, b = np.array([[int(number) for number in pair] for pair in named]).T
    gap = b - a
    step = float(np.median(np.diff(a))) if a.size > 1 else 1.0
    film = bool(np.isin(b, a).any() or (gap > 1).any())
    if gap.min() < 1 or step < 1 or (np.diff(a) <= 0).any() or not film:
        return parts
    frames = gap / step
    uneven = frames != frames[0]
    if (frames == 1).all() and (np.diff(a) == step).all():
        return parts
    k = int(np.argmax(uneven))
    if uneven.any() and not units.has(parts[0].velocity_unit, "frame"):
        raise DataFileError(
            f"{files[k]} has images that are {gap[k]} apart, and those of {files[0]} are {gap[0]} "
            f"apart, but velocities in {parts[0].velocity_unit or 'an unknown unit'} were made "
            "with one time for all pairs: export all files in pixels and px/frame"
        )
    apart = f"{gap[0]}" if not uneven.any() else f"{gap.min()} to {gap.max()}"
    said = (
        f"the names of the images: those of a pair are {apart} apart, so every pair has its own "
        "time; --frame-rate is the rate of the frames in the usual step of "
        f"{step:g} image{'s' * (step != 1)}"
    )
    facts = {PAIR_FRAMES: f"{frames[0]:.17g}", SAID: said}
    times = ((a + b) - (a[0] + b[0])) / (2 * step)
    changed = []
    for part, t, ratio in zip(parts, times, frames[0] / frames, strict=True):
        scaled: dict[str, Any] = {
            name: values * ratio
            for name, values in part.arrays().items()
            if name in ("u", "v", "sigma_u", "sigma_v")
        }
        t = np.full(part.t.shape, t)
        changed.append(replace(part, t=t, facts=part.facts | facts, **scaled))
    return changed
