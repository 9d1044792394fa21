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
from typing import Any

import cv2
import numpy as np
import pandas as pd
import scipy

from granpinn.arrays import Bool, Float32, Float64
from granpinn.filming.frames import Picture

LARGEST = 8.0  # px between the first and the last image of a vector
LONGEST = 8  # largest h, frames
WINDOW = 1.5  # grain diameters, the side of a window
MOST, FEWEST = 3000, 30  # features of a frame
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


def side_of_window(grain: float) -> int:
    """Side of a window for grains of so many pixels, an odd number."""
    return 2 * int(np.clip(WINDOW * grain, 7, 31) // 2) + 1


def features(picture: Picture, grain: float, where: Picture, most: int = MOST) -> Float64:
    """Places [n, 2] of corners, spread over the grains [rows, columns] (not 0)."""
    apart = max(0.75 * grain, 0.7 * np.sqrt(np.count_nonzero(where) / most))
    corners = cv2.goodFeaturesToTrack(picture, most, QUALITY, apart, mask=where, blockSize=5)
    return np.zeros((0, 2)) if corners is None else corners[:, 0].astype(np.float64)


def follow(first: Picture, second: Picture, places: Float64, window: int) -> tuple[Float32, Bool]:
    """Displacements [n, 2] of places [n, 2] to another picture, and whether they come back [n]."""
    if len(places) == 0:
        return np.zeros((0, 2), np.float32), np.zeros(0, bool)
    start = places.astype(np.float32)
    options: Any = {"winSize": (window, window), "maxLevel": LEVELS, "criteria": _STOP}
    options["nextPts"] = None
    there, seen, _ = cv2.calcOpticalFlowPyrLK(first, second, start, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, there, **options)
    inside = (there >= 0).all(1) & (there < first.shape[::-1]).all(1)
    close = np.hypot(*(back - start).T) < MAX_RETURN
    return there - start, (seen[:, 0] == 1) & (again[:, 0] == 1) & inside & close


def velocities(
    pictures: Mapping[int, Picture], grain: float, where: Picture, reach: int
) -> pd.DataFrame:
    """The vectors of the frame `pictures[0]`; none if too few pass all tests.

    Args:
        pictures: by their number relative to that frame.
        grain: diameter, px.
        where: not 0 where there are grains.
        reach: the largest h for which the frames from -h to h can be used.

    Returns:
        x, y: px, y down. u, v: px/frame. sd: standard deviation of u and of v.
        temperature: half of the mean square of the residual motion; noise is in it.
        step: h. good: whether the vector passed all tests.
    """
    window = side_of_window(grain)
    places = features(pictures[0], grain, where)
    moved, found = follow(pictures[0], pictures[1], places, window)
    places, moved = places[found], moved[found]
    cell = places // max(REGION * grain, 32.0)
    fast = pd.Series(np.hypot(*moved.T)).groupby([*cell.T]).transform("quantile", FAST).to_numpy()
    most = np.clip(LARGEST / (2 * np.maximum(fast, 1e-3)), 1, min(reach, LONGEST))
    step = 2 ** np.floor(np.log2(most)).astype(np.int64)
    velocity, good = np.zeros((len(places), 2)), np.zeros(len(places), bool)
    for h in np.unique(step):
        now = step == h
        ahead, behind = (follow(pictures[0], pictures[k], places[now], window) for k in (h, -h))
        velocity[now] = (ahead[0] - behind[0]) / (2 * h)
        good[now] = ahead[1] & behind[1]
    scatter = np.zeros(len(places))
    if good.sum() >= FEWEST:
        # Outliers differ from the median of their neighbors by more than these do.
        near = velocity[good][_nearest(places[good])[:, 1:]]
        median = np.median(near, axis=1)
        usual = np.median(np.abs(near - median[:, None]), axis=1) + LATTICE / step[good, None]
        good[good] = (np.abs(velocity[good] - median) <= MAX_MEDIAN * usual).all(axis=1)
    good &= good.sum() >= FEWEST
    if good.any():
        scatter[good] = _scatter(places[good], velocity[good])
    sd = np.sqrt((ROUNDING / step) ** 2 + SCATTER * scatter)
    columns = *places.T, *velocity.T, sd, scatter, step, good
    names = ("x", "y", "u", "v", "sd", "temperature", "step", "good")
    return pd.DataFrame(dict(zip(names, columns, strict=True)))


def _nearest(places: Float64) -> Any:
    """Indices [n, 1 + NEIGHBORS] of each place and its neighbors."""
    return scipy.spatial.cKDTree(places).query(places, NEIGHBORS + 1)[1]


def _scatter(places: Float64, velocity: Float64) -> Float64:
    """Variance [n] of one component around a plane through the neighbors of each place."""
    near = _nearest(places)
    plane = np.insert(places[near] - places[:, None], 0, 1.0, axis=2)
    q = np.linalg.qr(plane)[0]
    left = velocity[near] - q @ (q.transpose(0, 2, 1) @ velocity[near])
    return np.asarray((left**2).sum(axis=(1, 2)) / (2 * (NEIGHBORS + 1 - 3)))
