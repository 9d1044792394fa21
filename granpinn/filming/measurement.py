"""From the frames of a film to a flow: what is in it, the vectors, the surface, the conversion."""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from granpinn.arrays import Bool, Float64, Int64
from granpinn.data.flow import Flow, FlowFileWarning, Surface
from granpinn.filming import FilmSettings
from granpinn.filming.frames import ImageSequence, Picture, opened
from granpinn.filming.segmentation import Segmentation, floor, segmented, traced
from granpinn.filming.survey import Survey, UsableFrames, judged, survey
from granpinn.filming.tracking import LONGEST, WINDOW, TrackedVectors, velocities
from granpinn.importers import DataFileError, Settings, convert, units, vector_fields
from granpinn.importers.limits import read_file
from granpinn.importers.source import frames_of

MAX_FIELDS = 200  # frames with vectors, unless --frames chooses others
SAMPLES = 9  # pictures for the segmentation
FEWEST = 30  # vectors of a frame
SURFACE_SD = 0.1  # of the offset of the line, grain diameters (bench/studies/film)
RISING = 0.1  # mean velocity against gravity, of the rms speed
SLOW, FAST = 0.02, 1.5  # acceleration of the fast grains after the release over gravity
SHOWN = (0.25, 0.6)  # of the fields, for the page


class Field(NamedTuple):
    """A measured frame, for the page."""

    number: int
    picture: Picture
    vectors: TrackedVectors


@dataclass(frozen=True, eq=False)
class Measured:
    """A film and what was measured in it.

    Attributes:
        fields: some frames with their vectors. line: the surface, px, y up, t in frames.
        said: sentences for the user: pairing, release, segmentation.
    """

    flow: Flow
    film: Survey
    judgement: UsableFrames
    fields: list[Field]
    line: Surface | None
    said: list[str]


def measure(
    sources: str | Path | Sequence[str | Path],
    settings: FilmSettings,
    report: Callable[[str], None] | None = None,
) -> Measured:
    """The flow of a film with all stages; arguments and errors as of `granpinn.film`."""
    tell = report or (lambda line: None)
    grain = _grain(settings)
    frames = opened([sources] if isinstance(sources, str | Path) else list(sources))
    frames.region = _region(settings.roi)
    pictures = frames.sample(SAMPLES)
    rows, columns = pictures[0].shape
    view = _view(settings.mask, frames, (rows, columns))
    segmentation = segmented(pictures, grain)
    tell(f"film: {frames.count} frames of {columns} x {rows} px, grains of {grain:.3g} px")
    film = survey(frames, lambda p: segmentation.grains(p, view), grain)
    judgement = judged(film, frames)
    for text in judgement.said:
        warnings.warn(text, FlowFileWarning, stacklevel=3)
    centers, reach = _centers(judgement, settings)
    parts, fields, levels = _vectors(frames, centers, reach, segmentation, view, grain)
    said = _said(judgement, [*parts.values()], segmentation)
    for text in said:
        tell(text)
    times = np.array([*parts], float)
    kept = [v.kept() for v in parts.values()]
    t = np.repeat(times, [v.x.size for v in kept])
    names = ("x", "y", "u", "v", "sd")
    x, y, u, v, sd = (np.concatenate([getattr(part, name) for part in kept]) for name in names)

    def edge(tilt: float) -> Surface | None:
        if not segmentation.useful:
            return None
        return traced(np.stack(levels), times, grain, (rows, columns), view, tilt)

    if settings.tilt == "auto":
        settings, text = _upright(floor(edge(math.pi), grain), u, v, settings)
        said.append(text)
        tell(text)
    angle = units.si(settings.tilt, "angle", "--tilt")
    _require_falling(u, v, angle, judgement.acceleration, settings)
    line = edge(angle) if settings.surface == "auto" else None
    given = None
    if line is not None:
        keep = _below(line, t, x, rows - y, grain)
        t, x, y, u, v, sd = (values[keep] for values in (t, x, y, u, v, sd))
        # Pixel 0 reaches from 0 to 1 in the line; its center is 0 in the vectors.
        given = line.t, line.x - 0.5, rows - line.y - 0.5
        d = units.si(settings.grain_diameter or "", "length", "--grain-diameter")
        sd_of_line = settings.surface_sd or f"{SURFACE_SD * d!r} m"
        settings = dataclasses.replace(settings, surface_sd=sd_of_line)
    vectors = vector_fields(
        **{"t": t, "x": x, "y": y, "u": u, "v": v, "sigma_u": sd, "sigma_v": sd.copy()},
        length_unit="px",
        time_unit="frame",
        velocity_unit="px/frame",
        y_down=True,
        facts={"format": "film, features by OpenCV", "opencv": cv2.__version__},
    )
    flow = convert(vectors, _settings(settings, judgement, t), report, given)
    return Measured(flow, film, judgement, fields, line, said)


def _below(line: Surface, t: Float64, x: Float64, y: Float64, grain: float) -> Bool:
    """Which vectors [n] have a window below the line.

    Grains at the surface hide those below them and have none above: a window that reaches beyond
    them shows the velocity of their centers, which is too slow there (bench/studies/film).
    """
    keep = np.ones(t.size, bool)
    for time in np.unique(line.t):
        points, vectors = line.t == time, t == time
        tree = cKDTree(np.stack([line.x[points], line.y[points]], -1))
        places = np.stack([x[vectors], y[vectors]], -1)
        keep[vectors] = tree.query(places)[0] > WINDOW / 2 * grain
    return keep


def _grain(settings: FilmSettings) -> float:
    """Diameter of a grain in px."""
    missing = [
        f"--{name.replace('_', '-')}"
        for name in ("scale", "frame_rate", "grain_diameter")
        if getattr(settings, name) is None
    ]
    if missing:
        raise DataFileError(
            f"a film needs {', '.join(missing)}, got none: give them as --scale '0.12 mm/px' "
            "--frame-rate '1500 Hz' --grain-diameter '0.8 mm'"
        )
    d = units.si(settings.grain_diameter or "", "length", "--grain-diameter")
    grain = d / units.scale(settings.scale or "")
    if not 2 <= grain <= 100:
        raise DataFileError(
            f"a grain must be 2 to 100 px wide, got {grain:.3g} px: check --scale and "
            "--grain-diameter, or film from another distance"
        )
    return grain


def _region(roi: str | None) -> tuple[slice, slice]:
    if roi is None:
        return slice(None), slice(None)
    try:
        columns, rows = (slice(*(int(n) for n in part.split(":"))) for part in roi.split(","))
        good = all(0 <= s.start < s.stop and s.step is None for s in (rows, columns))
    except (ValueError, TypeError):
        good = False
    if not good:
        raise DataFileError(f"--roi must be LEFT:RIGHT,TOP:BOTTOM in px, got {roi!r}")
    return rows, columns


def _view(mask: str | None, frames: ImageSequence, shape: tuple[int, ...]) -> Picture | None:
    """Not 0 where the mask image is bright."""
    if mask is None:
        return None
    image = read_file("frames", Path(mask))["frames"][0][frames.region]
    if image.shape != shape:
        raise DataFileError(
            f"--mask must have the {list(shape)} pixels of the film, got {list(image.shape)}"
        )
    return np.where(image > image.max() / 2, 255, 0).astype(np.uint8)


def _centers(judgement: UsableFrames, settings: FilmSettings) -> tuple[list[int], Int64]:
    """Frames that get vectors, and for every frame the largest h [T]."""
    index = np.arange(judgement.whole.size)
    run = pd.Series(index).groupby(np.cumsum(~judgement.joined))
    before, later = run.cumcount(), run.cumcount(ascending=False)
    reach = np.where(judgement.whole, np.minimum(before, later), 0)
    since = np.floor(index - (judgement.release or 0.0)).astype(int)
    reach = np.minimum(reach, np.maximum(since, 0))  # grains at rest are no part of the motion
    good = reach > 0
    if settings.frames is not None:
        good &= np.isin(index, index[frames_of(settings.frames)])
    centers = np.flatnonzero(good)
    if settings.frames is None and centers.size > MAX_FIELDS:
        centers = centers[np.linspace(0, centers.size - 1, MAX_FIELDS).astype(int)]
    if centers.size < settings.fewest_frames:
        raise DataFileError(
            f"{settings.fewest_words} between whole frames must show the flow, got {centers.size}: "
            "give more frames"
        )
    return centers.tolist(), reach


def _vectors(
    frames: ImageSequence,
    centers: list[int],
    reach: Int64,
    segmentation: Segmentation,
    view: Picture | None,
    grain: float,
) -> tuple[dict[int, TrackedVectors], list[Field], list[Any]]:
    """The second pass: vectors, by their frame, and level of grains; few frames in memory."""
    wanted, shown = set(centers), {centers[int(s * len(centers))] for s in SHOWN}
    parts: dict[int, TrackedVectors] = {}
    fields, levels = [], []
    ring: deque[Any] = deque([None] * (2 * LONGEST + 1), 2 * LONGEST + 1)
    following = itertools.chain((frame.picture for frame in frames), [None] * LONGEST)
    for c, picture in enumerate(following, -LONGEST):
        ring.append(picture)
        if c not in wanted:
            continue
        now = dict(zip(range(-LONGEST, LONGEST + 1), ring, strict=True))
        vectors = velocities(now, grain, segmentation.grains(now[0], view), int(reach[c]))
        if vectors.good.sum() < FEWEST:
            continue
        parts[c] = vectors
        levels.append(segmentation.level(now[0]))
        if c in shown:
            fields.append(Field(c, now[0], vectors))
    if len(parts) < 2:
        raise DataFileError(
            f"at least two frames must have {FEWEST} vectors in the grains, got {len(parts)}: "
            "check --scale and --grain-diameter, the light and the sharpness of the film"
        )
    return parts, fields, levels


def _upright(
    found: tuple[float, float] | None, u: Float64, v: Float64, settings: FilmSettings
) -> tuple[FilmSettings, str]:
    """The settings with the tilt of a level floor, and how it was found.

    Grains that flow down to a level floor fall on the average; those on a slope move along it.
    """
    if found is None:
        raise DataFileError(
            "--tilt auto needs a straight floor with background below it in the picture, got none: "
            "give the angle of a plumb line"
        )
    angle, sd = (math.degrees(value) for value in found)
    if _descent(u, v, found[0]) < RISING:
        raise DataFileError(
            f"--tilt auto takes the floor, at {angle:.1f} deg, as level, but the grains move along "
            "it, as on a slope: give the angle of a plumb line"
        )
    text = f"tilt {angle:.2f} +- {sd:.2f} deg, of the straight floor, which is taken as level"
    return dataclasses.replace(settings, tilt=f"{angle!r} deg"), text


def _descent(u: Float64, v: Float64, angle: float) -> float:
    """Mean velocity along gravity, of the rms speed."""
    return float(np.mean(math.sin(angle) * u + math.cos(angle) * v) / np.sqrt(np.mean(u**2 + v**2)))


def _require_falling(
    u: Float64, v: Float64, angle: float, acceleration: float, settings: FilmSettings
) -> None:
    """Refuses a film in which grains rise or gain speed faster than in a free fall.

    Warns of an acceleration after the release that is a small part of gravity.
    """
    gravity = units.si(settings.gravity, "acceleration", "--gravity")
    frame = units.frame_time(settings.frame_rate or "", "--frame-rate")
    share = acceleration * units.scale(settings.scale or "") / frame**2 / gravity
    said = (
        f"the grains gain speed with {share:.2g} times gravity after the release, expected {SLOW} "
        f"to {FAST}: check --frame-rate, whose square is in it, and --scale"
    )
    if share < SLOW:
        warnings.warn(said, FlowFileWarning, stacklevel=4)
    if share > FAST and not settings.force:
        raise DataFileError(f"{said}, or give --force")
    if _descent(u, v, angle) < -RISING and not settings.force:
        raise DataFileError(
            "grains must fall on the average, but they rise: turn the pictures the right way up, "
            "check --tilt and the order of the frames, or give --force"
        )


def _said(
    judgement: UsableFrames, parts: list[TrackedVectors], segmentation: Segmentation
) -> list[str]:
    """How frames were paired, how many vectors passed, the release and the segmentation."""
    good = np.concatenate([v.good for v in parts])
    steps, counts = np.unique(np.concatenate([v.step for v in parts])[good], return_counts=True)
    shares = counts / good.sum()
    pairs = ", ".join(f"{2 * h} frames: {n:.0%}" for h, n in zip(steps, shares, strict=True))
    release = judgement.release
    kind = "texture" if segmentation.texture else "brightness"
    return [
        f"vectors in {len(parts)} frames, {good.sum()} kept and {(~good).sum()} rejected; time "
        f"between their first and last image, chosen by region: {pairs}",
        "the grains move from the first frame on; if they start from rest, give --start"
        if release is None
        else f"the grains are released at frame {release:.1f}",
        f"grains are found by {kind}: {segmentation.separated:.0%} of the contrast is theirs"
        if segmentation.useful
        else "the picture shows no background: the surface is that of the vectors",
    ]


def _settings(settings: FilmSettings, judgement: UsableFrames, t: Float64) -> Settings:
    """The settings of the conversion: times count from the release."""
    if settings.surface in ("mask", "fraction"):
        raise DataFileError(f"--surface {settings.surface} is not for films: leave it out")
    frame = units.frame_time(settings.frame_rate or "", "--frame-rate")
    first = float(t.min()) * frame
    if settings.start is not None:  # of the first frame of the film
        first += units.si(settings.start, "time", "--start")
    else:
        first -= (judgement.release or 0.0) * frame
    return dataclasses.replace(settings, mask=None, frames=None, start=f"{first!r} s")
