r"""Velocities of one frame: features, followed to an earlier and to a later frame.

A feature at x in frame c is found at $x_+$ in frame c + h and at $x_-$ in frame c - h by the
pyramidal method of Lucas and Kanade. Its velocity at frame c is $(x_+ - x_-) / 2h$, in px/frame, of
second order in time. h is 1, 2, 4, ... and chosen region by region: the largest one for which the
fast grains of the region move by at most `LARGEST` px from the first to the last image.

The standard deviation has two parts, with factors from rendered films (bench/studies/film): the
lattice of pixels, and the scatter of the neighbors around a plane, which also holds the motion of
single grains. So the scatter is also the granular temperature, with the noise in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import cv2
import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from granpinn.arrays import Bool, Float32, Float64, Floats, Int64
from granpinn.filming.frames import Picture

SMALLEST, LARGEST = 2.0, 8.0  # px between the first and the last image of a vector
LONGEST = 8  # largest h, frames
WINDOW = 1.5  # grain diameters, the side of a window
MOST = 3000  # features of a frame
QUALITY = 0.003  # of the strongest feature
LEVELS = 2  # of the pyramid above the pictures; the last one has pixels 4 times as large
MAX_RETURN = 1.0  # px, the forward-backward error of a vector
NEIGHBORS = 12
MAX_MEDIAN = 3.0  # deviation from the median of the neighbors, in their usual deviation
LATTICE = 0.1  # px, the least deviation that counts
REGION = 8.0  # grain diameters, the side of a region
FAST = 0.9  # quantile of the speed in a region
ROUNDING, SCATTER = 0.01, 0.8  # deviation by the lattice, px; part of the variance of neighbors
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003)


@dataclass(frozen=True, eq=False)
class TrackedVectors:
    """Vectors of one frame, each [n].

    Attributes:
        x, y: px, y down. u, v: px/frame.
        sd: standard deviation of u and of v.
        temperature: half of the mean square of the residual motion; noise is in it.
        step: h. good: whether the vector passed all tests.
    """

    x: Float64
    y: Float64
    u: Float64
    v: Float64
    sd: Float64
    temperature: Float64
    step: Int64
    good: Bool

    def kept(self) -> TrackedVectors:
        """The vectors that passed all tests."""
        return TrackedVectors(**{f.name: getattr(self, f.name)[self.good] for f in fields(self)})


def side_of_window(grain: float) -> int:
    """Side of a window for grains of so many pixels, an odd number."""
    return 2 * int(np.clip(WINDOW * grain, 7, 31) // 2) + 1


def features(picture: Picture, grain: float, where: Picture | None, most: int = MOST) -> Float64:
    """Places [n, 2] of corners, spread over the grains [rows, columns] (not 0)."""
    area = picture.size if where is None else int(np.count_nonzero(where))
    apart = max(0.75 * grain, 0.7 * np.sqrt(area / most))
    corners = cv2.goodFeaturesToTrack(picture, most, QUALITY, apart, mask=where, blockSize=5)
    return np.zeros((0, 2)) if corners is None else corners[:, 0].astype(np.float64)


def follow(
    first: Picture, second: Picture, places: Float64, window: int, guess: Floats | None = None
) -> tuple[Float32, Bool]:
    """Displacements [n, 2] from one picture to another, and whether they come back [n].

    Args:
        places, guess: where the features are, and their displacements [n, 2]; none: 0.
    """
    if len(places) == 0:
        return np.zeros((0, 2), np.float32), np.zeros(0, bool)
    start = places.astype(np.float32)
    moved = np.zeros_like(start) if guess is None else guess.astype(np.float32)
    options: Any = {"winSize": (window, window), "maxLevel": LEVELS, "criteria": _STOP}
    options["flags"] = cv2.OPTFLOW_USE_INITIAL_FLOW
    there, seen, _ = cv2.calcOpticalFlowPyrLK(first, second, start, start + moved, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, there, there - moved, **options)
    rows, columns = first.shape
    inside = (there >= 0).all(1) & (there[:, 0] < columns) & (there[:, 1] < rows)
    close = np.hypot(*(back - start).T) < MAX_RETURN
    return there - start, (seen[:, 0] == 1) & (again[:, 0] == 1) & inside & close


def velocities(
    pictures: Mapping[int, Picture], grain: float, where: Picture, reach: int
) -> TrackedVectors:
    """The vectors of the frame `pictures[0]`.

    Args:
        pictures: by their number relative to that frame.
        grain: diameter, px.
        where: not 0 where there are grains.
        reach: the largest h for which the frames from -h to h can be used.
    """
    window = side_of_window(grain)
    places = features(pictures[0], grain, where)
    moved, found = follow(pictures[0], pictures[1], places, window)
    places, guess = places[found], moved[found]
    fast = _fast(places, np.hypot(*guess.T), grain)
    most = np.clip(LARGEST / (2 * np.maximum(fast, 1e-3)), 1, min(reach, LONGEST))
    step = 2 ** np.floor(np.log2(most)).astype(np.int64)
    velocity, good = np.zeros((len(places), 2)), np.zeros(len(places), bool)
    for h in np.unique(step):
        now = step == h
        ahead, behind = (
            follow(pictures[0], pictures[sign * h], places[now], window, sign * h * guess[now])
            for sign in (1, -1)
        )
        velocity[now] = (ahead[0] - behind[0]) / (2 * h)
        good[now] = ahead[1] & behind[1]
    good[good] = ~_outliers(places[good], velocity[good], step[good])
    scatter = np.zeros(len(places))
    scatter[good] = _scatter(places[good], velocity[good])
    sd = np.sqrt((ROUNDING / step) ** 2 + SCATTER * scatter)
    (x, y), (u, v) = places.T, velocity.T
    return TrackedVectors(x, y, u, v, sd, scatter, step, good)


def _fast(places: Float64, size: Float64, grain: float) -> Float64:
    """Displacement [n] of the fast grains in the region of each place."""
    cell = places // max(REGION * grain, 32.0)
    return np.asarray(pd.Series(size).groupby([*cell.T]).transform("quantile", FAST), np.float64)


def _outliers(places: Float64, velocity: Float64, step: Int64) -> Bool:
    """Vectors [n] that differ from the median of their neighbors by more than these do.

    All of them where they are too few.
    """
    if len(places) <= 2 * NEIGHBORS:
        return np.ones(len(places), bool)
    around = velocity[cKDTree(places).query(places, NEIGHBORS + 1)[1][:, 1:]]
    median = np.median(around, axis=1)
    usual = np.median(np.abs(around - median[:, None]), axis=1) + LATTICE / step[:, None]
    return np.asarray((np.abs(velocity - median) > MAX_MEDIAN * usual).any(axis=1))


def _scatter(places: Float64, velocity: Float64) -> Float64:
    """Variance [n] of one component around a plane through the neighbors of each place."""
    if len(places) <= NEIGHBORS:
        return np.zeros(len(places))
    near = cKDTree(places).query(places, NEIGHBORS + 1)[1]
    plane = np.insert(places[near] - places[:, None], 0, 1.0, axis=2)
    q = np.linalg.qr(plane)[0]
    left = velocity[near] - q @ (q.transpose(0, 2, 1) @ velocity[near])
    return np.asarray((left**2).sum(axis=(1, 2)) / (2 * (NEIGHBORS + 1 - 3)))
