"""One rule for quantities that are stated twice: by files, their headers, neighbors, and flags.

Two statements of one quantity that differ by more than `TOLERANCE` stop the conversion. The message
has both values, their sources and the flags that settle it. With --force the flags hold.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from granpinn.data.flow import FlowFileWarning
from granpinn.importers import units
from granpinn.importers.frame import PAIR_FRAMES, Frame
from granpinn.importers.numerals import number
from granpinn.importers.settings import SURFACES, Settings
from granpinn.importers.vectors import TRACK_WINDOW, DataFileError, VectorFields

TOLERANCE = 0.02  # relative
NEVER_SET = 1.0  # s between two images, the default of programs
# Facts of a calibration: meters per pixel, m/s of one pixel per pair, time of a pair.
CALXY, CALUV, CALU, PULSE_DELAY = "calxy", "caluv", "calu", "pulse_delay_us"
_UNITS = {CALXY: "m/px", CALUV: "m/s per px/frame", CALU: "m/s per px/frame", PULSE_DELAY: "us"}
_MICROSECONDS = 1e-6
# PIV programs are wrong by about 0.1 px, and their windows, of up to 256 px, do not find
# displacements of more than half of them.
LEAST_PIXELS, MOST_PIXELS = 0.1, 128.0
FASTEST = 0.99  # quantile of the speed


class Statement(NamedTuple):
    """A value, as `text` in a message, and who states it."""

    value: float
    text: str
    source: str


def require_agreement(quantity: str, settle: str, *statements: Statement | None) -> None:
    """Refuses statements of one quantity that differ; None states nothing.

    Args:
        settle: what the user can do, for the message.
    """
    made = [statement for statement in statements if statement is not None]
    for other in made[1:]:
        if not math.isclose(made[0].value, other.value, rel_tol=TOLERANCE):
            said = ", ".join(f"{one.source} says {one.text}" for one in (made[0], other))
            raise DataFileError(f"{quantity} is stated twice: {said}: {settle}")


def require_one_calibration(stated: Mapping[Path, Mapping[str, str]]) -> None:
    """Refuses a series in which the calibration changes, at the first file that differs.

    Args:
        stated: the facts of every file.
    """
    for name, unit in _UNITS.items():
        made = [
            Statement(_number(facts, name, path), f"{facts[name]} {unit}", path.name)
            for path, facts in stated.items()
            if name in facts
        ]
        again = "calibrate all images alike and export them again, or convert the files apart"
        require_agreement(f"the calibration {name} of a series", again, *made)


def _number(facts: Mapping[str, str], name: str, path: object = "the header") -> float:
    return abs(number(facts[name], f"{path}: {name}"))


def calibration(facts: Mapping[str, str]) -> tuple[float | None, float | None]:
    """Meters per pixel and seconds between the images of a pair, None where a file states none.

    PIVlab writes the factors 1 and 1 for vectors that are not calibrated.
    """
    if PULSE_DELAY in facts:
        return None, _number(facts, PULSE_DELAY) * _MICROSECONDS or None
    factor = CALUV if CALUV in facts else CALU
    if CALXY not in facts:
        return None, None
    pixel = _number(facts, CALXY)
    velocity = _number(facts, factor) if factor in facts else 0.0
    if pixel == 0 or pixel == velocity == 1:
        return None, None
    return pixel, pixel / velocity if velocity else None


def settled(fields: VectorFields, settings: Settings, frame: Frame) -> Frame:
    """The frame, if the settings do not contradict the files; with --force the settings hold.

    Args:
        fields: all vectors, in the units of the files.

    Raises:
        DataFileError: a quantity is stated twice.
    """
    pixel, delay = calibration(fields.facts)
    if settings.dimensionless:
        return frame
    if settings.force:
        units_of_files = (fields.length_unit, fields.velocity_unit)
        length, velocity = (units.has(unit, "px") for unit in units_of_files)
        scale = frame.pixel / pixel if pixel and frame.pixel else 1.0
        slowed = delay / frame.delay if delay and frame.delay else 1.0
        per_pair = units.has(settings.velocity_unit or fields.velocity_unit, "frame")
        return replace(
            frame,
            length=frame.length * (1.0 if length else scale),
            velocity=frame.velocity * (1.0 if velocity else scale) * (1.0 if per_pair else slowed),
        )
    _scale(fields, settings, frame, pixel)
    _delay(fields, settings, frame, delay)
    _interval(fields, settings, frame)
    _units(fields, settings)
    return frame


def _scale(fields: VectorFields, settings: Settings, frame: Frame, pixel: float | None) -> None:
    if settings.scale is None or frame.pixel is None:
        return
    flag = Statement(frame.pixel, settings.scale, "--scale")
    if pixel is not None:
        header = Statement(pixel, units.shown(pixel, "m/px"), "the header")
        settle = (
            "leave --scale out if the header is right, else give --force with the right --scale"
        )
        require_agreement("the size of a pixel", settle, header, flag)
        return
    length = settings.length_unit or fields.length_unit
    used = (
        length,
        settings.velocity_unit,
        fields.velocity_unit,
        *((text or "").partition(" ")[2] for text in (settings.sigma, settings.window)),
    )
    tables = settings.walls or settings.surface not in SURFACES
    if not tables and not any(units.has(unit, "px") for unit in used):
        warnings.warn(
            f"--scale {settings.scale} changes nothing, as the files are in {length}: if they are "
            "in pixels, give --length-unit px and --velocity-unit px/frame",
            FlowFileWarning,
            stacklevel=4,
        )


def _delay(fields: VectorFields, settings: Settings, frame: Frame, delay: float | None) -> None:
    velocity = settings.velocity_unit or fields.velocity_unit
    per_pair = units.has(velocity, "frame")
    header = None
    if delay is not None and not (per_pair and delay == NEVER_SET):
        text = units.shown(delay, "s")
        text += " (exactly 1, so probably never set)" * (delay == NEVER_SET)
        header = Statement(delay, text, "the header")
    names = None
    if PAIR_FRAMES in fields.facts and frame.interval is not None:
        between = float(fields.facts[PAIR_FRAMES]) * frame.interval
        names = Statement(between, units.shown(between, "s"), "the numbering of the images")
    # The two pulses of double frames have nothing to do with the frame rate.
    double = PULSE_DELAY in fields.facts and settings.pulse_delay is None
    flag = "--frame-rate" if settings.pulse_delay is None else "--pulse-delay"
    user = None
    if frame.delay is not None and not double:
        user = Statement(frame.delay, units.shown(frame.delay, "s"), f"{flag} (you)")
    settle = "leave --pulse-delay out, or give --force if the names are wrong"
    if header is not None:
        settle = f'give --pulse-delay "{header.text.partition(" (")[0]}" for double frames if the '
        settle += "header is right; "
        if delay == NEVER_SET:
            settle += "--velocity-unit m/frame if its time was never set; "
        settle += f"or --force with the right {flag} if the header is wrong"
    require_agreement("the time between the two images of a pair", settle, header or names, user)


def _interval(fields: VectorFields, settings: Settings, frame: Frame) -> None:
    unit = settings.time_unit or fields.time_unit
    times = np.unique(fields.t)
    interval = frame.interval
    if interval is None or frame.counts or times.size < 2:
        return
    steps = np.diff(times) * frame.time  # the shortest one is that of a film without lost frames
    step = min(float(np.median(steps)), float(steps.min()), key=lambda s: abs(s - interval))
    source = "--times" if settings.times else "the file"
    require_agreement(
        "the time between two frames",
        "leave --frame-rate out if these times are right, or give --pulse-delay "
        f"'{units.shown(interval, 's')}' in its place if the images of a pair are so far apart; "
        f"else give --time-unit frame to count the frames, or another one if it is not {unit}",
        Statement(step, units.shown(step, "s"), source),
        Statement(interval, units.shown(interval, "s"), "--frame-rate"),
    )


def _units(fields: VectorFields, settings: Settings) -> None:
    for name in ("length_unit", "time_unit", "velocity_unit"):
        stated, given = getattr(fields, name), getattr(settings, name)
        if TRACK_WINDOW in fields.facts and name == "velocity_unit":
            continue  # it follows from the others
        if stated and given and units.same_dimension(stated, given):
            flag = f"--{name.replace('_', '-')}"
            require_agreement(
                f"the {name.replace('_', ' ')}",
                f"leave {flag} out (the flow file has SI units, whatever the files have), or give "
                "--force if the file is wrong",
                Statement(1.0, stated, "the file"),
                Statement(units.ratio(given, stated, flag), given, flag),
            )


def warn_of_displacement(si: VectorFields, frame: Frame) -> None:
    """Warns if the fastest vectors move by less or more than a PIV program can measure.

    Args:
        si: vectors in SI units.
        frame: with the size of a pixel and the time between two images, where they are known.
    """
    if frame.pixel is None or frame.delay is None or not si.usable.any():
        return
    speed = np.hypot(si.u[si.usable], si.v[si.usable])
    moved = float(np.quantile(speed, FASTEST)) * frame.delay / frame.pixel
    if moved > 0 and not LEAST_PIXELS <= moved <= MOST_PIXELS:
        warnings.warn(
            f"the fastest vectors move by {moved:.3g} px between two images, and PIV programs "
            f"measure {LEAST_PIXELS:g} to {MOST_PIXELS:g} px: check --scale, --velocity-unit, "
            "--frame-rate and --pulse-delay",
            FlowFileWarning,
            stacklevel=3,
        )
