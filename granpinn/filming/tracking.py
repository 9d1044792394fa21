r"""Velocities of one frame: features, followed to an earlier and to a later frame.

A feature at x in frame c is found at $x_+$ in frame c + h and at $x_-$ in frame c - h by the
pyramidal method of Lucas and Kanade. Its velocity at frame c is $(x_+ - x_-) / 2h$, in px/frame, of
second order in time. h is 1, 2, 4, ... and chosen region by region: the largest one for which the
fast grains of the region move by at most `LARGEST` px from the first to the last image.

The standard deviation has four parts, weighted by `WEIGHTS`, which were fitted on rendered films
(bench/studies/film): the lattice of pixels, the forward-backward error, the grey levels that are
left over between the images, and the scatter of the neighbors around a plane, which also holds the
motion of single grains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from granpinn.arrays import Bool, Float64, Int64
from granpinn.filming.frames import Picture

SMALLEST, LARGEST = 2.0, 8.0  # px between the first and the last image of a vector
LONGEST = 8  # largest h, frames
WINDOW = 1.5  # grain diameters, the side of a window
MOST = 3000  # features of a frame
QUALITY = 0.003  # of the strongest feature
MAX_RETURN = 1.0  # px, the forward-backward error of a vector
NEIGHBORS = 12
MAX_MEDIAN = 3.0  # deviation from the median of the neighbors, in their usual deviation
LATTICE = 0.1  # px, the least deviation that counts
REGION = 8.0  # grain diameters, the side of a region
FAST = 0.9  # quantile of the speed in a region
# Of the variances: lattice [px^2], forward-backward, noise, scatter of the neighbors.
WEIGHTS = (5.2e-5, 0.29, 0.12, 0.55)
_GRADIENT = 255 / 2  # grey levels per pixel in one unit of OpenCV's eigenvalues, over the window
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003)


class Motion(NamedTuple):
    """Displacements [n, 2], forward-backward errors [n], and whether both ways were found [n]."""

    moved: npt.NDArray[np.float32]
    back: Float64
    found: Bool
    residual: Float64


@dataclass(frozen=True, eq=False)
class Vectors:
    """Vectors of one frame, each [n].

    Attributes:
        x, y: px, y down. u, v: px/frame.
        sd: standard deviation of u and of v.
        parts: variances [n, 4] in the order of WEIGHTS, without their weights, px^2/frame^2.
        temperature: half of the mean square of the residual motion; noise is in it.
        step: h. good: whether the vector passed all tests.
    """

    x: Float64
    y: Float64
    u: Float64
    v: Float64
    sd: Float64
    parts: Float64
    temperature: Float64
    step: Int64
    good: Bool

    def kept(self) -> Vectors:
        """The vectors that passed all tests."""
        return Vectors(**{f.name: getattr(self, f.name)[self.good] for f in fields(self)})


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
    first: Picture,
    second: Picture,
    places: Float64,
    window: int,
    guess: Float64 | None = None,
    levels: int = 3,
) -> Motion:
    """Follows places [n, 2] from one picture to another and back.

    Args:
        guess: displacements [n, 2]; none: the search begins where they are.
    """
    if len(places) == 0:
        empty = np.zeros(0)
        return Motion(np.zeros((0, 2), np.float32), empty, empty > 0, empty)
    start = places.astype(np.float32)
    moved = np.zeros_like(start) if guess is None else guess.astype(np.float32)
    flags = cv2.OPTFLOW_USE_INITIAL_FLOW
    size = (window, window)
    options: Any = {"winSize": size, "maxLevel": levels, "criteria": _STOP, "flags": flags}
    there, seen, residual = cv2.calcOpticalFlowPyrLK(first, second, start, start + moved, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, there, there - moved, **options)
    rows, columns = first.shape
    inside = (there >= 0).all(1) & (there[:, 0] < columns) & (there[:, 1] < rows)
    found = (seen[:, 0] == 1) & (again[:, 0] == 1) & inside
    error = np.hypot(*(back - start).T).astype(np.float64)
    return Motion(there - start, error, found, residual[:, 0].astype(np.float64))


def velocities(
    pictures: Mapping[int, Picture], grain: float, where: Picture, reach: int
) -> Vectors:
    """The vectors of the frame `pictures[0]`.

    Args:
        pictures: by their number relative to that frame.
        grain: diameter, px.
        where: not 0 where there are grains.
        reach: the largest h for which the frames from -h to h can be used.
    """
    window = side_of_window(grain)
    places = features(pictures[0], grain, where)
    near = follow(pictures[0], pictures[1], places, window)
    sure = near.found & (near.back < MAX_RETURN)
    places = places[sure]
    speed, guess = _regions(places, near.moved[sure].astype(np.float64), grain)
    step = 2 ** np.floor(np.log2(LARGEST / (2 * np.maximum(speed, 1e-3))))
    step = np.clip(step, 1, min(reach, LONGEST)).astype(np.int64)
    step = 2 ** np.floor(np.log2(step)).astype(np.int64)
    n = len(places)
    ahead, behind = np.zeros((n, 2)), np.zeros((n, 2))
    back, residual, found = np.full(n, np.inf), np.zeros(n), np.zeros(n, bool)
    for h in np.unique(step):
        now = step == h
        ways = [
            follow(pictures[0], pictures[sign * h], places[now], window, sign * h * guess[now], 2)
            for sign in (1, -1)
        ]
        ahead[now], behind[now] = (way.moved for way in ways)
        back[now] = np.sqrt((ways[0].back ** 2 + ways[1].back ** 2) / 2)
        residual[now] = (ways[0].residual + ways[1].residual) / 2
        found[now] = ways[0].found & ways[1].found
    velocity = (ahead - behind) / (2 * step)[:, None]
    good = found & (back < MAX_RETURN)
    return _judged(pictures[0], places, velocity, step, good, back, residual, window)


def _regions(places: Float64, moved: Float64, grain: float) -> tuple[Float64, Float64]:
    """Speed of the fast grains [n] and median displacement [n, 2] of the region of each place."""
    if len(places) == 0:
        return np.zeros(0), np.zeros((0, 2))
    cell = (places // max(REGION * grain, 32.0)).astype(np.int64)
    _, region = np.unique(cell, axis=0, return_inverse=True)
    speed, median = np.zeros(region.max() + 1), np.zeros((region.max() + 1, 2))
    for k in range(speed.size):
        own = moved[region == k]
        speed[k] = np.quantile(np.hypot(*own.T), FAST)
        median[k] = np.median(own, axis=0)
    return speed[region], median[region]


def _judged(
    picture: Picture,
    places: Float64,
    velocity: Float64,
    step: Int64,
    good: Bool,
    back: Float64,
    residual: Float64,
    window: int,
) -> Vectors:
    """Outliers by the median of the neighbors, and standard deviations."""
    good = good & ~_outliers(places, velocity, good, step)
    slack = np.full(len(places), np.nan)
    if good.sum() > NEIGHBORS:
        slack[good] = _scatter(places[good], velocity[good])
    good = good & np.isfinite(slack)
    slack[~good] = 0
    # Variance of the grey levels over the sum of the squared gradient along its weaker direction.
    sharp = cv2.cornerMinEigenVal(picture, window, ksize=3).astype(np.float64)
    column, row = places.astype(np.int64).T if len(places) else np.zeros((2, 0), np.int64)
    noise = (residual / (_GRADIENT * window)) ** 2 / np.maximum(sharp[row, column], 1e-9)
    over = (1.0 / step) ** 2
    parts = np.stack([over, over * back**2, over * noise, slack], axis=1)
    parts[~np.isfinite(parts)] = 0
    sd = np.sqrt(parts @ np.array(WEIGHTS))
    (x, y), (u, v) = places.T, velocity.T
    return Vectors(x, y, u, v, sd, parts, slack, step, good)


def _outliers(places: Float64, velocity: Float64, good: Bool, step: Int64) -> Bool:
    """Vectors that differ from the median of their neighbors by more than these do."""
    wrong = np.zeros(len(places), bool)
    if good.sum() <= NEIGHBORS:
        return wrong
    near = cKDTree(places[good]).query(places[good], NEIGHBORS + 1)[1][:, 1:]
    own = velocity[good]
    around = own[near]
    median = np.median(around, axis=1)
    usual = np.median(np.abs(around - median[:, None]), axis=1) + LATTICE / step[good, None]
    wrong[good] = (np.abs(own - median) > MAX_MEDIAN * usual).any(axis=1)
    return wrong


def _scatter(places: Float64, velocity: Float64) -> Float64:
    """Variance [n] of one component around a plane through the neighbors of each place."""
    near = cKDTree(places).query(places, NEIGHBORS + 1)[1]
    offset = places[near] - places[:, None]
    scale = np.sqrt((offset**2).mean(axis=(1, 2)))[:, None, None] + 1e-9
    plane = np.concatenate([np.ones((*near.shape, 1)), offset / scale], axis=2)
    normal = plane.transpose(0, 2, 1) @ plane + 1e-9 * np.eye(3)
    solved = np.linalg.solve(normal, plane.transpose(0, 2, 1) @ velocity[near])
    left = velocity[near] - plane @ solved
    return np.asarray((left**2).sum(axis=(1, 2)) / (2 * (NEIGHBORS + 1 - 3)))
