"""Grains and background of a picture, by brightness, or by texture where brightness is alike.

Texture puts the edge up to a grain too far out if the background has another brightness.

The quantity is averaged over about a grain. Where it is half way between its value in the grains
around and that of the background, there is the edge of the grains. The grains are the rougher of
the two classes, so they may be brighter or darker than the background.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, median_filter

from granpinn.arrays import Bool, Float64
from granpinn.data.flow import Surface
from granpinn.filming.frames import Picture
from granpinn.importers.density import without_holes
from granpinn.importers.surface import HALF, from_fraction

Level = npt.NDArray[np.float32]

CELL = 0.5  # side of a cell of the fraction, grain diameters
SMOOTHING = 0.5  # standard deviation of the average, grain diameters
EDGE = 3.0  # of the average that evens out single grains of the surface, cells
JITTER = 3  # cells by which the edge moves along a wall at rest
AROUND = 8.0  # of the mean over the grains around, cells
SEPARATED = 0.72  # part of the variance between the classes; at most 0.66 in grains alone
MAX_JUMP = 0.1  # change of the area of the grains from frame to frame that a flow can make
FLOOR = 15.0  # least length of a floor, grain diameters
OF_EDGE = 1 / 3  # least part of the lower edge within half a grain of it; no floor: up to 0.17


@dataclass(frozen=True)
class Segmentation:
    """How the grains of a film are told from the background.

    Attributes:
        grain: diameter, px. texture: whether by texture, not by brightness.
        inside, outside: usual values in the grains and in the background.
        separated: part of the variance that is between the two classes, 0 to 1.
    """

    grain: float
    texture: bool
    inside: float
    outside: float
    separated: float

    @property
    def useful(self) -> bool:
        """Whether there are two classes."""
        return self.separated > SEPARATED

    def level(self, picture: Picture) -> Level:
        """1 in the grains, 0 in the background, both with scatter [rows, columns] of cells."""
        values = _averaged(picture, self.grain, self.texture)
        sign = 1.0 if self.inside > self.outside else -1.0
        within = (sign * values > sign * (self.inside + self.outside) / 2).astype(np.float32)
        share = gaussian_filter(within, AROUND)
        around = gaussian_filter(values * within, AROUND) / np.maximum(share, 1e-6)
        around = np.where(share > 1e-3, around, self.inside)
        return np.asarray((values - self.outside) / (around - self.outside), np.float32)

    def grains(self, picture: Picture, view: Picture | None) -> Picture:
        """Not 0 at the pixels inside the grains and the view [rows, columns]."""
        rows, columns = picture.shape
        if self.useful:
            level = without_holes(self.level(picture).astype(np.float64), np.array([0.0, -1.0]))
            large = cv2.resize(level, (columns, rows), interpolation=cv2.INTER_LINEAR)
            inside = np.where(large > HALF, 255, 0).astype(np.uint8)
        else:
            inside = np.full(picture.shape, 255, np.uint8)
        return inside if view is None else np.minimum(inside, view)


def segmented(pictures: Sequence[Picture], grain: float) -> Segmentation:
    """By brightness if that separates two classes, else by the better one; of the whole film."""
    rough = np.stack([_averaged(picture, grain, True) for picture in pictures])
    found = [Segmentation(grain, False, 1.0, 0.0, 0.0)]
    for texture in (False, True):
        values = rough if texture else np.stack([_averaged(p, grain, False) for p in pictures])
        high, separated = _split(np.sqrt(np.maximum(values, 0)))
        if separated > 0:
            grains = high if rough[high].mean() >= rough[~high].mean() else ~high
            inside, outside = float(np.median(values[grains])), float(np.median(values[~grains]))
            found.append(Segmentation(grain, texture, inside, outside, separated))
    return max(found, key=lambda s: (s.useful and not s.texture, s.separated))


def traced(
    levels: npt.NDArray[np.float32],
    t: Float64,
    grain: float,
    shape: tuple[int, int],
    view: Picture | None,
    tilt: float,
) -> Surface | None:
    """The free surface, in px with y up from the lower edge.

    Frames in which the area jumps have no points.

    Args:
        levels: of the frames at the times t [T, rows, columns].
        shape: rows and columns of a picture.
        tilt: of the plumb line in the picture, radians.
    """
    up = np.array([-math.sin(tilt), math.cos(tilt)])
    even = (gaussian_filter(level[::-1], EDGE, mode="nearest") for level in levels)
    c = np.stack([without_holes(level, up) for level in even])
    sizes = [n / cells for n, cells in zip(shape, c.shape[1:], strict=True)]
    y, x = (size * (np.arange(cells) + 0.5) for size, cells in zip(sizes, c.shape[1:], strict=True))
    area = c.sum(axis=(1, 2))
    steady = np.abs(area / median_filter(area, 5, mode="nearest") - 1) < MAX_JUMP
    if view is not None:
        near = cv2.erode(view, np.ones((2 * int(grain) + 1,) * 2, np.uint8))
        c[:, cv2.resize(near, c.shape[:0:-1], interpolation=cv2.INTER_AREA)[::-1] < 255] = np.nan
    return from_fraction(c[steady], t[steady], y, x, (-up[0], -up[1]), JITTER)


def floor(edge: Surface | None, grain: float) -> tuple[float, float] | None:
    """Angle of the straight floor below the grains and its standard deviation, radians.

    The line within a grain of the most points of the lower edge. Both of its ends are known to the
    rms distance of the edge.

    Args:
        edge: the line that `traced` finds in a picture turned by 180 degrees, px, y up.
    """
    if edge is None:
        return None
    x, y = edge.x / grain, edge.y / grain
    points = np.stack([x, y], -1)[:, None].astype(np.float32)
    reach, eighth = float(np.hypot(x, y).max()), math.pi / 4
    normals = eighth, 3 * eighth, eighth / 90
    lines = cv2.HoughLinesPointSet(points, 1, 1, -reach, reach, CELL, *normals)
    _, distance, normal = lines.reshape(-1, 3)[0]
    slope, level = -1 / math.tan(normal), distance / math.sin(normal)
    for _ in range(5):
        away = y - level - slope * x
        near = np.abs(away) < 1
        length = CELL * np.unique(x[near] // CELL).size
        if length < FLOOR or np.mean(np.abs(away) < HALF) < OF_EDGE:
            return None
        slope, level = np.polyfit(x[near], y[near], 1)
    sd = math.sqrt(2) * float(np.std(away[near])) / length / (1 + slope**2)
    return math.atan(slope), sd


def _averaged(picture: Picture, grain: float, texture: bool) -> Level:
    """Mean brightness, or variance of the grey levels, around every cell."""
    values = picture.astype(np.float32)
    sd = SMOOTHING * grain
    mean = cv2.GaussianBlur(values, (0, 0), sd)
    if texture:
        mean = cv2.GaussianBlur(values * values, (0, 0), sd) - mean * mean
    cells = [max(2, round(n / (CELL * grain))) for n in picture.shape]
    return np.asarray(cv2.resize(mean, (cells[1], cells[0]), interpolation=cv2.INTER_AREA))


def _split(values: Level) -> tuple[Bool, float]:
    """The upper class of Otsu, and the part of the variance that lies between the classes."""
    grey = np.interp(values, (values.min(), values.max() + 1e-9), (0, 255)).astype(np.uint8)
    high = grey > cv2.threshold(grey.ravel(), 0, 255, cv2.THRESH_OTSU)[0]
    share = high.mean()
    if not 0 < share < 1:
        return high, 0.0
    between = share * (1 - share) * (values[high].mean() - values[~high].mean()) ** 2
    return high, float(between / values.var())
