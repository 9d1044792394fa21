"""Conversion from the units and axes of the files to SI (or none).

The axes of the result are x to the right and y up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from granpinn.arrays import Float64
from granpinn.importers import units
from granpinn.importers.grids import MIXED, ROWS
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import TRACK_WINDOW, DataFileError, VectorFields

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
        pixel, delay, interval: meters per pixel; seconds between the images of a pair, and between
            frames; or None.
        dimensionless: whether there are no units.
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
    pixel: float | None = None
    delay: float | None = None
    interval: float | None = None
    dimensionless: bool = False
    counts: bool = False

    def apply(self, fields: VectorFields) -> VectorFields:
        """The same vectors in SI."""
        x, y = self.place(fields.x, fields.y)
        changes: dict[str, Any] = dict(fields.arrays())
        factors = dict.fromkeys(("u", "sigma_u", "sigma_v"), self.velocity)
        for name, factor in {**factors, "v": self.up * self.velocity}.items():
            if name in changes:
                changes[name] = changes[name] * factor
        if self.up < 0 and not fields.scattered:
            y = y[::-1]
            changes = {name: values[:, ::-1] for name, values in changes.items()}
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
        if not unit:
            return self.times(t)
        if not units.has(unit, "frame"):
            return t * self.factor(unit, "time", what)
        if not self.counts or self.interval is None:
            raise DataFileError(
                f"{what} must be a time, as the vectors have times, got numbers of frames: give "
                "a column t"
            )
        if unit == "frame":
            return self.times(t)
        return self.times(t * self.factor(unit, "time", what) / self.interval)

    def factor(self, unit: str | None, dimension: str, what: str) -> float:
        """SI units in one unit of a column; without a unit it has that of the vectors.

        Args:
            dimension: length, time, velocity or pressure, which has no unit of the vectors.
            what: the column, for messages.
        """
        if not unit or (self.dimensionless and unit in ("1", "-")):
            return float(getattr(self, dimension, 1.0))
        if self.dimensionless:
            raise DataFileError(f"{what} must be without a unit with --dimensionless, got {unit}")
        frame = self.interval if dimension == "time" else self.delay
        return units.factor(unit, dimension, what, self.pixel, frame)

    def number(self, text: str, dimension: str, flag: str) -> float:
        """The number of a flag in SI, such as that of --sigma '0.1 px/frame'."""
        if self.dimensionless:
            found = units.plain(text, flag)
        else:
            value, unit = units.split(text, flag)
            found = value * self.factor(unit or "1", dimension, flag)
        return units.in_range(found, flag, text)


def missing_units(fields: VectorFields, settings: Settings) -> list[str]:
    """The settings that are missing for the units, one sentence part each."""
    if settings.dimensionless:
        lacking = _counted(fields, settings) and settings.frame_rate is None
        return ["--times, or --frame-rate in frames per unit of time"] if lacking else []
    length, time, velocity = _units(fields, settings)
    missing = [
        f"{flag} (the files do not say the unit of {what})"
        for flag, value, what in (
            ("--length-unit", length, "x and y"),
            ("--velocity-unit", velocity or fields.facts.get(TRACK_WINDOW), "u and v"),
            ("--time-unit", time, "t"),
        )
        if value is None
    ]
    if settings.scale is None and (units.has(length, "px") or units.has(velocity, "px")):
        missing.append("--scale, such as '0.12 mm/px' (the vectors are in pixels)")
    if settings.frame_rate is None and units.has(time, "frame"):
        missing.append("--frame-rate, such as '500 Hz' (the files hold no time)")
    elif not (settings.pulse_delay or settings.frame_rate) and units.has(velocity, "frame"):
        missing.append("--pulse-delay, such as '2 ms' (the vectors are per pair of images)")
    unclear = units.has(length, "px") or fields.facts.get(ROWS) == MIXED
    if settings.flip_y == "auto" and fields.y_down is None and unclear:
        missing.append("--flip-y yes or no (the files do not say whether y points down)")
    return missing


def _up(fields: VectorFields, settings: Settings) -> int:
    """-1 where y and v of the files point down, else 1."""
    down = fields.y_down if settings.flip_y == "auto" else settings.flip_y == "yes"
    return -1 if down else 1


def frame_of(fields: VectorFields, settings: Settings) -> Frame:
    """Calibration, origin and gravity; `missing_units` must be empty.

    Raises:
        DataFileError: a unit is wrong.
    """
    up = _up(fields, settings)
    counted = _counted(fields, settings)
    pixel = interval = delay = None
    g: float | None = 1.0
    if settings.dimensionless:
        length = time = velocity = 1.0
        if counted:
            rate = settings.frame_rate or ""
            value = units.plain(rate, "--frame-rate")
            time = interval = 1 / units.in_range(value, "--frame-rate", rate)
    else:
        if settings.scale is not None:
            pixel = units.scale(settings.scale)
        if settings.frame_rate is not None:
            interval = delay = units.frame_time(settings.frame_rate, "--frame-rate")
        if settings.pulse_delay is not None:
            delay = units.frame_time(settings.pulse_delay, "--pulse-delay")
        names = _units(fields, settings)
        length = units.factor(names[0] or "", "length", "--length-unit", pixel)
        time = units.factor(names[1] or "", "time", "--time-unit", pixel, interval)
        velocity = units.factor(names[2] or "", "velocity", "--velocity-unit", pixel, delay)
    if not settings.dimensionless or settings.gravity != Settings.gravity:
        g = settings.number("gravity")
    assert g is not None
    angle = units.si(settings.tilt, "angle", "--tilt")
    if not abs(angle) < math.pi / 2:
        raise DataFileError(
            f"--tilt must be an angle between -90 and 90 deg, got {settings.tilt!r}: turn the "
            "pictures by quarters first"
        )
    if TRACK_WINDOW in fields.facts:
        if settings.velocity_unit and not math.isclose(velocity, length / time):
            raise DataFileError(
                f"--velocity-unit must be the unit of x and y over that of t for tracks, got "
                f"{settings.velocity_unit}: leave it out"
            )
        velocity = length / time
    t0, start = float(fields.t.min()), settings.number("start")
    if start is None and counted and interval is not None:
        start = 0.0 if fields.scattered else HALF * interval
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
        pixel=pixel,
        delay=delay,
        interval=interval,
        dimensionless=settings.dimensionless,
        counts=counted,
    )


def _counted(fields: VectorFields, settings: Settings) -> bool:
    """Whether the times are numbers of frames."""
    return units.has(settings.time_unit or fields.time_unit, "frame")


def _units(fields: VectorFields, settings: Settings) -> tuple[str | None, str | None, str | None]:
    """Units of length, time and velocity, from the settings if they have them, else the files."""
    length = settings.length_unit or fields.length_unit
    time = settings.time_unit or fields.time_unit
    velocity = settings.velocity_unit or fields.velocity_unit
    if settings.velocity_unit is None and TRACK_WINDOW in fields.facts:
        velocity = None if None in (length, time) else f"{length}/{time}"
    elif velocity is None and settings.length_unit and (settings.time_unit or fields.scattered):
        velocity = None if time is None else f"{length}/{time}"
    return length, time, velocity


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
