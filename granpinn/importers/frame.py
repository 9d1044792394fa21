"""Conversion from the units and axes of the files to SI (or none).

The axes of the result are x to the right and y up. Two statements of one quantity, by files, their
headers and flags, that differ by more than `TOLERANCE` stop the conversion. The message has both
values, their sources and what settles it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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
        if not unit:
            return self.times(t)
        if not units.has(unit, "frame"):
            return t * self.factor(unit, "time", what)
        interval = self.calibration.interval
        if not self.counts or interval is None:
            raise DataFileError(
                f"{what} must be a time, as the vectors have times, got numbers of frames: give "
                "a column t"
            )
        return self.times(t * self.factor(unit, "time", what) / interval)

    def factor(self, unit: str | None, dimension: str, what: str) -> float:
        """SI units in one unit of a column; without a unit it has that of the vectors.

        Args:
            dimension: length, time, velocity or pressure, which has no unit of the vectors.
            what: the column, for messages.
        """
        if not unit:
            return float(getattr(self, dimension, 1.0))
        return self.calibration.factor(unit, dimension, what)


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
    calibration = settings.calibration
    names = _units(fields, settings)
    length = calibration.factor(names[0] or "", "length", "--length-unit")
    time = calibration.factor(names[1] or "", "time", "--time-unit")
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
        velocity = calibration.factor(names[2] or "", "velocity", "--velocity-unit")
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


TOLERANCE = 0.02  # relative
NEVER_SET = 1.0  # s between two images, the default of programs


class Statement(NamedTuple):
    """A value, as `text` in a message, and who states it."""

    value: float
    text: str
    source: str


def _require_equal(quantity: str, settle: str, first: Statement, other: Statement) -> None:
    """Refuses statements of one quantity that differ; `settle` is what the user can do."""
    if not math.isclose(first.value, other.value, rel_tol=TOLERANCE):
        said = ", ".join(f"{one.source} says {one.text}" for one in (first, other))
        raise DataFileError(f"{quantity} is stated twice: {said}: {settle}")


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
    if settings.dimensionless:
        return
    pixel, delay = stated_calibration(fields.facts)
    known = frame.calibration
    if pixel is not None and settings.scale is not None and known.pixel is not None:
        _require_equal(
            "the size of a pixel",
            "leave --scale out if the header is right, else export the vectors in pixels",
            Statement(pixel, units.shown(pixel, "m/px"), "the header"),
            Statement(known.pixel, settings.scale, "--scale"),
        )
    if delay is not None and known.delay is not None:
        _delay(fields, settings, known.delay, delay)
    _interval(fields, settings, frame)
    _require_same_units(fields, settings)


def _delay(fields: VectorFields, settings: Settings, given: float, stated: float) -> None:
    """The time between the images of a pair, `given` by a flag and `stated` by the header."""
    if stated == NEVER_SET and units.has(settings.velocity_unit or fields.velocity_unit, "frame"):
        return
    flag = "--frame-rate" if settings.pulse_delay is None else "--pulse-delay"
    shown = units.shown(stated, "s")
    _require_equal(
        "the time between the two images of a pair",
        f'give --pulse-delay "{shown}" for double frames if the header is right, '
        "--velocity-unit m/frame if its time was never set, which programs write as 1 s, or "
        "export the vectors in pixels if it is wrong",
        Statement(stated, shown, "the header"),
        Statement(given, units.shown(given, "s"), f"{flag} (you)"),
    )


def _interval(fields: VectorFields, settings: Settings, frame: Frame) -> None:
    unit = settings.time_unit or fields.time_unit
    times = np.unique(fields.t)
    interval = frame.calibration.interval
    if interval is None or frame.counts or times.size < 2:
        return
    steps = np.diff(times) * frame.time  # the shortest one is that of a film without lost frames
    step = min(float(np.median(steps)), float(steps.min()), key=lambda s: abs(s - interval))
    source = "--times" if settings.times else "the file"
    _require_equal(
        "the time between two frames",
        "leave --frame-rate out if these times are right, or give --pulse-delay "
        f"'{units.shown(interval, 's')}' in its place if the images of a pair are so far apart; "
        f"else give --time-unit frame to count the frames, or another one if it is not {unit}",
        Statement(step, units.shown(step, "s"), source),
        Statement(interval, units.shown(interval, "s"), "--frame-rate"),
    )


def _require_same_units(fields: VectorFields, settings: Settings) -> None:
    for name in ("length_unit", "time_unit", "velocity_unit"):
        stated, given = getattr(fields, name), getattr(settings, name)
        if TRACK_WINDOW in fields.facts and name == "velocity_unit":
            continue  # it follows from the others
        if stated and given and units.same_dimension(stated, given):
            flag = f"--{name.replace('_', '-')}"
            _require_equal(
                f"the {name.replace('_', ' ')}",
                f"leave {flag} out (the flow file has SI units, whatever the files have), or "
                "export the file again if it is wrong",
                Statement(1.0, stated, "the file"),
                Statement(units.ratio(given, stated, flag), given, flag),
            )
