"""Conversion from the units and axes of the files to SI (or none).

The axes of the result are x to the right and y up. Two statements of one quantity, by files, their
headers and flags, that differ by more than `TOLERANCE` stop the conversion. The message has both
values, their sources and what settles it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers import units
from granpinn.importers.grids import MIXED, ROWS
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import CALU, CALUV, CALXY, TRACK_WINDOW, DataFileError, VectorFields

HALF = 0.5  # a field between two images is half way between them


@dataclass(frozen=True)
class Frame:
    """A position in the files is (position - origin) * length in SI, y with the sign of `up`.

    Attributes:
        length, time, velocity: SI units in one unit of the files.
        x0, y0: the origin, in the units of the files.
        t0, start: the time t0 of the files is `start`, in SI.
        up: -1 where y and v of the files point down, else 1.
        gravity: (g_x, g_y) in the new axes.
        calibration: what is known of pixels and frames.
        counts: whether the times of the files are numbers of frames.
    """

    length: float
    time: float
    velocity: float
    x0: float
    y0: float
    t0: float
    start: float
    up: int
    gravity: tuple[float, float]
    calibration: units.Calibration
    counts: bool

    def apply(self, fields: VectorFields) -> VectorFields:
        """The same vectors in SI."""
        x, y = self.place(fields.x, fields.y)
        changes = {
            name: self.velocity * values
            for name in ("u", "v", "sigma_u", "sigma_v")
            if (values := getattr(fields, name)) is not None
        }
        changes["v"] *= self.up
        changes |= {"t": self.times(fields.t), "x": x, "y": y}
        return replace(fields, **changes, length_unit="m", time_unit="s", velocity_unit="m/s")

    def place(self, x: Float64, y: Float64) -> tuple[Float64, Float64]:
        """Positions in SI."""
        # + 0.0: the origin is 0, not -0.
        return (x - self.x0) * self.length, self.up * (y - self.y0) * self.length + 0.0

    def times(self, t: Float64) -> Float64:
        """Times in SI."""
        return (t - self.t0) * self.time + self.start

    def moments(self, t: Float64, unit: str | None, what: str) -> Float64:
        """Times in SI of a column with its unit; a time in its own unit counts from the release."""
        counted = units.has(unit, "frame")
        if counted and not self.counts:
            raise DataFileError(
                f"{what} must be a time, as the vectors have times, got numbers of frames: give "
                "a column t"
            )
        factor = self.factor(unit, "time", what)
        return t * factor if unit and not counted else self.times(t)

    def factor(self, unit: str | None, dimension: str, what: str) -> float:
        """SI units in one unit of a column; without a unit it has that of the vectors.

        Args:
            dimension: length, time, velocity or pressure, which has no unit of the vectors.
            what: the column, for messages.
        """
        if not unit:
            return float(getattr(self, dimension, 1.0))
        return self.calibration.factor(unit, dimension, what)


def with_units(fields: VectorFields, settings: Settings) -> VectorFields:
    """The vectors with the units of the settings, where they state some."""
    length = settings.length_unit or fields.length_unit
    time = settings.time_unit or fields.time_unit
    velocity = settings.velocity_unit or fields.velocity_unit
    follows = settings.length_unit and (settings.time_unit or fields.scattered) and not velocity
    if follows or (TRACK_WINDOW in fields.facts and not settings.velocity_unit):
        velocity = None if None in (length, time) else f"{length}/{time}"
    return replace(fields, length_unit=length, time_unit=time, velocity_unit=velocity)


def require_complete(fields: VectorFields, settings: Settings) -> None:
    """Refuses settings that lack a unit or a constant that the files do not state.

    Args:
        fields: vectors `with_units`.

    Raises:
        DataFileError: one names all that is missing.
    """
    length, time, velocity = fields.length_unit, fields.time_unit, fields.velocity_unit
    counted, rate = units.has(time, "frame"), settings.frame_rate
    pixels, frames = units.has(length, "px"), units.has(velocity, "frame")
    unclear = settings.flip_y == "auto" and fields.y_down is None
    unclear = unclear and (pixels or fields.facts.get(ROWS) == MIXED)
    no_scale = settings.scale is None and (pixels or units.has(velocity, "px"))
    no_delay = not counted and frames and not (settings.pulse_delay or rate)
    without = "(the files do not say the unit of"
    grain, bulk = settings.grain_density is None, settings.density is None
    fraction = settings.solid_fraction is None
    needed = {
        f"--length-unit {without} x and y)": length is None,
        f"--velocity-unit {without} u and v)": not (velocity or TRACK_WINDOW in fields.facts),
        f"--time-unit {without} t)": time is None,
        "--scale, such as '0.12 mm/px' (the vectors are in pixels)": no_scale,
        "--frame-rate, such as '500 Hz' (the files hold no time)": counted and rate is None,
        "--pulse-delay, such as '2 ms' (the vectors are per pair of images)": no_delay,
        "--flip-y yes or no (the files do not say whether y points down)": unclear,
        "--grain-density, such as '2500 kg/m^3'": grain and (bulk or fraction),
        "--solid-fraction, such as 0.6": bulk and fraction,
    }
    if settings.dimensionless:
        needed = {"--times, or --frame-rate in frames per unit of time": counted and rate is None}
    needed["--grain-diameter, such as '0.8 mm'"] = settings.grain_diameter is None
    if missing := [text for text, lacking in needed.items() if lacking]:
        raise DataFileError(f"missing: {'; '.join(missing)}")


def frame_of(fields: VectorFields, settings: Settings) -> Frame:
    """Calibration, origin and gravity of vectors `with_units` that are complete.

    Raises:
        DataFileError: a unit is wrong.
    """
    down = fields.y_down if settings.flip_y == "auto" else settings.flip_y == "yes"
    up = -1 if down else 1
    counted, calibration = units.has(fields.time_unit, "frame"), settings.calibration
    length = calibration.factor(fields.length_unit or "", "length", "--length-unit")
    time = calibration.factor(fields.time_unit or "", "time", "--time-unit")
    if TRACK_WINDOW in fields.facts:
        velocity, stated = length / time, settings.velocity_unit
        if stated and not math.isclose(
            velocity, calibration.factor(stated, "velocity", "--velocity-unit")
        ):
            raise DataFileError(
                f"--velocity-unit must be the unit of x and y over that of t for tracks, got "
                f"{stated}: leave it out"
            )
    else:
        velocity = calibration.factor(fields.velocity_unit or "", "velocity", "--velocity-unit")
    default = settings.dimensionless and settings.gravity == Settings.gravity
    g = 1.0 if default else settings.number("gravity") or 0.0
    angle = units.SI.number(settings.tilt, "angle", "--tilt")
    if not abs(angle) < math.pi / 2:
        raise DataFileError(
            f"--tilt must be an angle between -90 and 90 deg, got {settings.tilt!r}: turn the "
            "pictures by quarters first"
        )
    t0, start = float(fields.t.min()), settings.number("start")
    if start is None and counted and calibration.interval is not None:
        start = 0.0 if fields.scattered else HALF * calibration.interval
    if start is None:  # the times of the files
        t0 = start = 0.0
    return Frame(
        length,
        time,
        velocity,
        *_origin(fields, settings, up),
        t0,
        start,
        up,
        gravity=(g * math.sin(angle), -g * math.cos(angle)),
        calibration=calibration,
        counts=counted,
    )


def _origin(fields: VectorFields, settings: Settings, up: int) -> tuple[float, float]:
    """The origin in the coordinates of the files."""
    if settings.origin is None:
        if up < 0:  # an image: its own origin is the upper left corner
            return float(fields.x.min()), float(fields.y.max())
        return 0.0, 0.0
    parts = settings.origin.strip("()[] ").split(",")
    try:
        x0, y0 = (units.number(part, "--origin") for part in parts)
    except ValueError:
        raise DataFileError(f"--origin must be two numbers x,y, got {settings.origin!r}") from None
    return x0, y0


TOLERANCE = 0.02  # relative
NEVER_SET = 1.0  # s between two images, the default of programs


class Twice(NamedTuple):
    """A quantity that is stated twice.

    Attributes:
        values: the two, in one unit.
        said: who says what, twice.
        settle: what the user can do if they differ.
    """

    quantity: str
    values: tuple[float, float]
    said: tuple[str, str]
    settle: str


def stated_calibration(facts: Mapping[str, str]) -> tuple[float | None, float | None]:
    """Meters per pixel and seconds between the images of a pair, None where a file states none.

    PIVlab writes the factors 1 and 1 for vectors that are not calibrated.
    """
    if CALXY not in facts:
        return None, None
    pixel, velocity = (
        abs(units.number(facts.get(name, "0"), f"the header: {name}"))
        for name in (CALXY, CALUV if CALUV in facts else CALU)
    )
    if pixel == 0 or pixel == velocity == 1:
        return None, None
    return pixel, pixel / velocity if velocity else None


def require_agreement(fields: VectorFields, settings: Settings, frame: Frame) -> None:
    """Refuses settings that contradict the files.

    Args:
        fields: all vectors, in the units of the files.

    Raises:
        DataFileError: a quantity is stated twice.
    """
    for twice in () if settings.dimensionless else _stated_twice(fields, settings, frame):
        if not math.isclose(*twice.values, rel_tol=TOLERANCE):
            raise DataFileError(
                f"{twice.quantity} is stated twice: {', '.join(twice.said)}: {twice.settle}"
            )


def _stated_twice(fields: VectorFields, settings: Settings, frame: Frame) -> Iterator[Twice]:
    pixel, delay = stated_calibration(fields.facts)
    known = frame.calibration
    if pixel is not None and known.pixel is not None:
        yield Twice(
            "the size of a pixel",
            (pixel, known.pixel),
            (f"the header says {units.shown(pixel, 'm/px')}", f"--scale says {settings.scale}"),
            "leave --scale out if the header is right, else export the vectors in pixels",
        )
    per_frame = units.has(settings.velocity_unit or fields.velocity_unit, "frame")
    if delay is not None and known.delay is not None and not (delay == NEVER_SET and per_frame):
        flag = "--frame-rate" if settings.pulse_delay is None else "--pulse-delay"
        text = units.shown(delay, "s")
        yield Twice(
            "the time between the two images of a pair",
            (delay, known.delay),
            (f"the header says {text}", f"{flag} (you) says {units.shown(known.delay, 's')}"),
            f'give --pulse-delay "{text}" for double frames if the header is right, '
            "--velocity-unit m/frame if its time was never set, which programs write as 1 s, or "
            "export the vectors in pixels if it is wrong",
        )
    times, interval = np.unique(fields.t), known.interval
    if interval is not None and not frame.counts and times.size > 1:
        # The shortest step is that of a film without lost frames.
        steps = np.diff(times) * frame.time
        step = min(float(np.median(steps)), float(steps.min()), key=lambda s: abs(s - interval))
        source, text = "--times" if settings.times else "the file", units.shown(interval, "s")
        yield Twice(
            "the time between two frames",
            (step, interval),
            (f"{source} says {units.shown(step, 's')}", f"--frame-rate says {text}"),
            f"leave --frame-rate out if these times are right, or give --pulse-delay '{text}' in "
            "its place if the images of a pair are so far apart; else give --time-unit frame to "
            "count the frames, or the true unit of the times",
        )
    for name in ("length_unit", "time_unit", "velocity_unit"):
        stated, given = getattr(fields, name), getattr(settings, name)
        follows = name == "velocity_unit" and TRACK_WINDOW in fields.facts
        if stated and given and not follows and units.same_dimension(stated, given):
            flag = f"--{name.replace('_', '-')}"
            yield Twice(
                f"the {name.replace('_', ' ')}",
                (1.0, units.ratio(given, stated, flag)),
                (f"the file says {stated}", f"{flag} says {given}"),
                f"leave {flag} out (the flow file has SI units, whatever the files have), or "
                "export the file again if it is wrong",
            )
