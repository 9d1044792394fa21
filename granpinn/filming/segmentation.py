"""Grains and background of a picture, by brightness, or by texture where brightness is alike.

The quantity is averaged over about a grain. The edge is half way between its value in the grains
around and that of the background. Texture puts it up to a grain too far out if the brightness
differs. The grains are the rougher of the two classes; they may be brighter or darker.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import scipy

from granpinn.data.flow import Surface
from granpinn.filming.frames import Picture
from granpinn.importers.surface import HALF, from_fraction, without_holes

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


@dataclass(frozen=True, eq=False)
class Segmentation:
    """How the grains of a film are told from the background.

    Attributes:
        grain: diameter, px.
        view: not 0 where grains may be seen [rows, columns].
        texture: whether by texture, not by brightness.
        inside, outside: usual values in the grains and in the background.
        separated: part of the variance that is between the two classes, 0 to 1.
    """

    grain: float
    view: Picture
    texture: bool = False
    inside: float = 1.0
    outside: float = 0.0
    separated: float = 0.0

    @property
    def useful(self) -> bool:
        """Whether there are two classes."""
        return self.separated > SEPARATED

    def level(self, picture: Picture) -> Level:
        """1 in the grains, 0 in the background, both with scatter [rows, columns] of cells."""
        values = _averaged(picture, self.grain, self.texture)
        rise, middle = self.inside - self.outside, (self.inside + self.outside) / 2
        within = ((values - middle) * rise > 0).astype(np.float32)
        share = scipy.ndimage.gaussian_filter(within, AROUND)
        around = scipy.ndimage.gaussian_filter(values * within, AROUND) / np.maximum(share, 1e-6)
        around = np.where(share > 1e-3, around, self.inside)
        return np.asarray((values - self.outside) / (around - self.outside), np.float32)

    def grains(self, picture: Picture) -> Picture:
        """Not 0 at the pixels inside the grains [rows, columns]."""
        if not self.useful:
            return self.view
        level = without_holes(self.level(picture).astype(np.float64), np.array([0.0, -1.0]))
        large = cv2.resize(level, picture.shape[::-1], interpolation=cv2.INTER_LINEAR)
        return np.where(large > HALF, self.view, 0).astype(np.uint8)

    def line(self, levels: Mapping[int, Level], tilt: float) -> Surface | None:
        """The free surface, t in frames, x and y in px with y up from the lower edge.

        Frames in which the area jumps have no points.

        Args:
            levels: of frames by their number.
            tilt: of the plumb line in the picture, radians.
        """
        if not self.useful:
            return None
        up = np.array([-math.sin(tilt), math.cos(tilt)])
        even = (
            scipy.ndimage.gaussian_filter(level[::-1], EDGE, mode="nearest")
            for level in levels.values()
        )
        c = np.stack([without_holes(level, up) for level in even])
        area = c.sum(axis=(1, 2))
        steady = np.abs(area / scipy.ndimage.median_filter(area, 5, mode="nearest") - 1) < MAX_JUMP
        near = cv2.erode(self.view, np.ones((2 * int(self.grain) + 1,) * 2, np.uint8))
        c[:, cv2.resize(near, c.shape[:0:-1], interpolation=cv2.INTER_AREA)[::-1] < 255] = np.nan
        sizes = zip(self.view.shape, c.shape[1:], strict=True)
        y, x = (n * (np.arange(cells) + 0.5) / cells for n, cells in sizes)
        t = np.array([*levels], np.float64)
        return from_fraction(c[steady], t[steady], y, x, (-up[0], -up[1]), JITTER)

    def floor(self, levels: Mapping[int, Level]) -> tuple[float, float] | None:
        """Angle of the straight floor below the grains and its standard deviation, radians.

        The line within a grain of the most points of the lower edge. Both of its ends are known to
        the rms distance of the edge.
        """
        edge = self.line(levels, math.pi)
        if edge is None:
            return None
        x, y = edge.x / self.grain, edge.y / self.grain
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


def segmented(pictures: Sequence[Picture], grain: float, view: Picture) -> Segmentation:
    """By brightness if that separates two classes, else by the better one; of the whole film."""
    plain, rough = (
        np.stack([_averaged(picture, grain, texture) for picture in pictures])
        for texture in (False, True)
    )
    found = [Segmentation(grain, view)]
    for texture, values in ((False, plain), (True, rough)):
        even = np.sqrt(np.maximum(values, 0))
        grey = np.interp(even, (even.min(), even.max() + 1e-9), (0, 255)).astype(np.uint8)
        high = grey > cv2.threshold(grey.ravel(), 0, 255, cv2.THRESH_OTSU)[0]
        if high.any():
            classes = np.where(high, even[high].mean(), even[~high].mean())
            grains = high if rough[high].mean() >= rough[~high].mean() else ~high
            inside, outside = float(np.median(values[grains])), float(np.median(values[~grains]))
            separated = float(classes.var() / even.var())
            found.append(Segmentation(grain, view, texture, inside, outside, separated))
    return max(found, key=lambda s: (s.useful and not s.texture, s.separated))


def _averaged(picture: Picture, grain: float, texture: bool) -> Level:
    """Mean brightness, or variance of the grey levels, around every cell."""
    values = picture.astype(np.float32)
    sd = SMOOTHING * grain
    mean = cv2.GaussianBlur(values, (0, 0), sd)
    if texture:
        mean = cv2.GaussianBlur(values * values, (0, 0), sd) - mean * mean
    cells = [max(2, round(n / (CELL * grain))) for n in picture.shape]
    return np.asarray(cv2.resize(mean, (cells[1], cells[0]), interpolation=cv2.INTER_AREA))
