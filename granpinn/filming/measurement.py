"""From the frames of a film to a flow: what is in it, the vectors, the surface, the conversion."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import scipy

from granpinn.arrays import Bool
from granpinn.data.flow import Flow, Surface
from granpinn.errors import warn
from granpinn.filming import FilmSettings
from granpinn.filming.frames import ImageSequence, Picture
from granpinn.filming.segmentation import Segmentation, segmented
from granpinn.filming.survey import faults, release, survey
from granpinn.filming.tracking import FEWEST, LONGEST, WINDOW, velocities
from granpinn.importers import DataFileError, VectorFields, convert, units
from granpinn.importers.limits import read_file
from granpinn.importers.series import frames_of
from granpinn.importers.settings import SURFACES

MAX_FIELDS = 200  # frames with vectors, unless --frames chooses others
SAMPLES = 9  # pictures for the segmentation
SURFACE_SD = 0.1  # of the offset of the line, grain diameters (bench/studies/film)
RISING = 0.1  # mean velocity against gravity, of the rms speed
SLOW, FAST = 0.02, 1.5  # acceleration of the fast grains after the release over gravity
EVERYTHING = "0:999999999,0:999999999"  # a region of interest
SHOWN = 0.25, 0.6  # of the frames with vectors, for the page


@dataclass(frozen=True, eq=False)
class Measured:
    """A film and what was measured in it.

    Attributes:
        film: a row for every frame (survey.py). released: frame of the release, if it is seen.
        vectors: all vectors (tracking.py) with their frame t. pictures: some frames, by number.
        line: the surface, px, y up, t in frames. said: sentences for the user.
    """

    flow: Flow
    film: pd.DataFrame
    released: float | None
    vectors: pd.DataFrame
    pictures: dict[int, Picture]
    line: Surface | None
    said: list[str]


def measure(
    sources: str | Path | Sequence[str | Path],
    settings: FilmSettings,
    report: Callable[[str], None] | None = None,
) -> Measured:
    """The flow of a film with all stages; arguments and errors as of `granpinn.film`."""
    grain, pixel, frame = _calibration(settings)
    listed = [sources] if isinstance(sources, str | Path) else sources
    frames = ImageSequence(listed, _region(settings.roi))
    pictures = frames.sample(SAMPLES)
    rows, columns = pictures[0].shape
    segmentation = segmented(pictures, grain, _view(settings.mask, frames, (rows, columns)))
    film = survey(frames, segmentation)
    said = faults(film)
    for text in said:
        warn(text)
    released, acceleration = release(film)
    reach = _reach(film, released or 0.0, settings)
    vectors, shown, levels = _vectors(frames, reach, segmentation, settings.fewest_frames)
    kept = vectors[vectors.good]
    pairs = (2 * kept.step).value_counts(normalize=True).sort_index().map("{:.0%}".format)
    notes = [
        f"film: {frames.count} frames of {columns} x {rows} px, grains of {grain:.3g} px",
        f"vectors in {len(levels)} frames, {len(kept)} kept and {len(vectors) - len(kept)} "
        "rejected; time between their first and last image, chosen by region: "
        + ", ".join(f"{number} frames: {share}" for number, share in pairs.items()),
        "the grains move from the first frame on; if they start from rest, give --start"
        if released is None
        else f"the grains are released at frame {released:.1f}",
        f"grains are found by {'texture' if segmentation.texture else 'brightness'}: "
        f"{segmentation.separated:.0%} of the contrast is theirs"
        if segmentation.useful
        else "the picture shows no background: the surface is that of the vectors",
    ]
    if settings.tilt == "auto":
        tilt, sd = np.degrees(segmentation.floor(levels) or (0.0, math.nan)).tolist()
        if math.isnan(sd) or _descent(kept, math.radians(tilt)) < RISING:
            raise DataFileError(
                "--tilt auto needs background below a straight floor, and grains that fall onto it "
                "and do not move along it as on a slope: give the angle of a plumb line"
            )
        notes.append(f"tilt {tilt:.2f} +- {sd:.2f} deg, of the straight floor, taken as level")
        settings = dataclasses.replace(settings, tilt=f"{tilt!r} deg")
    angle = units.SI.number(settings.tilt, "angle", "--tilt")
    gravity = units.SI.number(settings.gravity, "acceleration", "--gravity")
    share = acceleration * pixel / frame**2 / gravity
    _require_falling(share, _descent(kept, angle), settings.force)
    for text in notes:
        (report or str)(text)
    given = line = None
    if settings.surface in SURFACES and settings.surface != "none":
        line = segmentation.line(levels, angle)
    if line is not None:
        kept = kept[_below(line, kept, rows, grain)]
        # Pixel 0 reaches from 0 to 1 in the line; its center is 0 in the vectors.
        given = line.t, line.x - 0.5, rows - line.y - 0.5
        sd_of_line = settings.surface_sd or f"{SURFACE_SD * grain * pixel!r} m"
        settings = dataclasses.replace(settings, surface_sd=sd_of_line)
    start = (float(kept.t.min()) - (released or 0.0)) * frame
    if settings.start is not None:  # of frame 0
        start = float(kept.t.min()) * frame + units.SI.number(settings.start, "time", "--start")
    fields = VectorFields(
        **{name: kept[name].to_numpy() for name in ("t", "x", "y", "u", "v")},
        sigma_u=kept.sd.to_numpy(),
        sigma_v=kept.sd.to_numpy(copy=True),
        length_unit="px",
        time_unit="frame",
        velocity_unit="px/frame",
        y_down=True,
        facts={"format": "film, features by OpenCV", "opencv": cv2.__version__},
    )
    settings = dataclasses.replace(settings, mask=None, frames=None, start=f"{start!r} s")
    flow = convert(fields, settings, report, given)
    return Measured(flow, film, released, vectors, shown, line, said + notes)


def _below(line: Surface, vectors: pd.DataFrame, rows: int, grain: float) -> Bool:
    """Which vectors [n] have a window below the line.

    Grains at the surface hide those below them and have none above: a window that reaches beyond
    them shows the velocity of their centers, which is too slow there (bench/studies/film).
    """
    reach = WINDOW / 2 * grain
    apart = 2 * reach  # of two frames: the line of another one is never near
    tree = scipy.spatial.cKDTree(np.stack([line.x, line.y, apart * line.t], -1))
    places = np.stack([vectors.x, rows - vectors.y, apart * vectors.t], -1)
    return np.asarray(np.isinf(tree.query(places, distance_upper_bound=reach)[0]))


def _calibration(settings: FilmSettings) -> tuple[float, float, float]:
    """Diameter of a grain in px, m per px, s per frame."""
    known, d = settings.calibration, settings.number("grain_diameter")
    if known.pixel is None or known.interval is None or d is None:
        raise DataFileError(
            "a film needs --scale '0.12 mm/px', --frame-rate '1500 Hz' and --grain-diameter "
            "'0.8 mm': give all of them"
        )
    grain = d / known.pixel
    if not 2 <= grain <= 100:
        raise DataFileError(
            f"a grain must be 2 to 100 px wide, got {grain:.3g} px: check --scale and "
            "--grain-diameter, or film from another distance"
        )
    return grain, known.pixel, known.interval


def _region(roi: str | None) -> tuple[slice, slice]:
    """Rows and columns of --roi."""
    numbers = re.fullmatch(r"(\d{1,9}):(\d{1,9}),(\d{1,9}):(\d{1,9})", roi or EVERYTHING)
    if numbers is None:
        raise DataFileError(f"--roi must be LEFT:RIGHT,TOP:BOTTOM in px, got {roi!r}")
    left, right, top, bottom = map(int, numbers.groups())
    return slice(top, bottom), slice(left, right)


def _view(mask: str | None, frames: ImageSequence, shape: tuple[int, ...]) -> Picture:
    """Not 0 where the mask image is bright, if there is one."""
    if mask is None:
        return np.full(shape, 255, np.uint8)
    image = read_file("frames", Path(mask))["frames"][0][frames.region]
    if image.shape != shape:
        raise DataFileError(
            f"--mask must have the {list(shape)} pixels of the film, got {list(image.shape)}"
        )
    return np.where(image > image.max() / 2, 255, 0).astype(np.uint8)


def _reach(film: pd.DataFrame, start: float, settings: FilmSettings) -> dict[int, int]:
    """The largest h of every frame that gets vectors."""
    run = film.groupby((~film.joined).cumsum())
    since = np.floor(film.index - start)  # grains at rest are no part of the motion
    reach = np.minimum(np.minimum(run.cumcount(), run.cumcount(ascending=False)), since)
    reach = reach.where(film.whole, 0)
    if settings.frames is not None:
        reach = reach[frames_of(settings.frames)]
    reach = reach[reach > 0]
    if settings.frames is None and len(reach) > MAX_FIELDS:
        reach = reach.iloc[np.linspace(0, len(reach) - 1, MAX_FIELDS).astype(int)]
    return {int(k): int(h) for k, h in reach.items()}


def _vectors(
    frames: ImageSequence, reach: dict[int, int], segmentation: Segmentation, fewest: int
) -> tuple[pd.DataFrame, dict[int, Picture], dict[int, Any]]:
    """The second pass, with few frames in memory.

    Returns:
        vectors, some pictures, and the level of grains of every frame with vectors.
    """
    chosen = {[*reach][int(share * len(reach))] for share in SHOWN if reach}
    parts: list[pd.DataFrame] = []
    shown: dict[int, Picture] = {}
    levels: dict[int, Any] = {}
    ring: deque[Any] = deque([None] * (2 * LONGEST + 1), 2 * LONGEST + 1)
    following = itertools.chain((picture for picture, _ in frames), [None] * LONGEST)
    for c, picture in enumerate(following, -LONGEST):
        ring.append(picture)
        if c not in reach:
            continue
        near = dict(zip(range(-LONGEST, LONGEST + 1), ring, strict=True))
        where = segmentation.grains(near[0])
        vectors = velocities(near, segmentation.grain, where, reach[c])
        if vectors.good.any():
            parts.append(vectors.assign(t=float(c)))
            levels[c] = segmentation.level(near[0])
            shown |= {c: near[0]} if c in chosen else {}
    if len(parts) < fewest:
        raise DataFileError(
            f"at least {fewest} frames, whole and after the release, must have {FEWEST} vectors in "
            f"the grains, got {len(parts)}: give more frames, and check --scale, "
            "--grain-diameter, the light and the sharpness of the film"
        )
    return pd.concat(parts, ignore_index=True), shown, levels


def _descent(vectors: pd.DataFrame, angle: float) -> float:
    """Mean velocity along gravity, of the rms speed."""
    u, v = vectors.u, vectors.v
    return float((math.sin(angle) * u + math.cos(angle) * v).mean() / np.sqrt((u**2 + v**2).mean()))


def _require_falling(share: float, descent: float, force: bool) -> None:
    """Refuses a film in which grains rise or gain speed faster than in a free fall.

    Warns of an acceleration after the release that is a small share of gravity.
    """
    said = (
        f"the grains gain speed with {share:.2g} times gravity after the release, expected {SLOW} "
        f"to {FAST}: check --frame-rate, whose square is in it, and --scale"
    )
    if share < SLOW:
        warn(said)
    if descent < -RISING:
        said = (
            "grains must fall on the average, but they rise: turn the pictures the right way up, "
            "check --tilt and the order of the frames"
        )
    if not force and (share > FAST or descent < -RISING):
        raise DataFileError(f"{said}, or give --force")
