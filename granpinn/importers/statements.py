"""One rule for quantities that are stated twice: by files, their headers, and flags.

Two statements of one quantity that differ by more than `TOLERANCE` stop the conversion. The message
has both values, their sources and what settles it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from granpinn.importers import units
from granpinn.importers.frame import Frame
from granpinn.importers.settings import Settings
from granpinn.importers.vectors import CALU, CALUV, CALXY, TRACK_WINDOW, DataFileError, VectorFields

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


def calibration(facts: Mapping[str, str]) -> tuple[float | None, float | None]:
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
    pixel, delay = calibration(fields.facts)
    if pixel is not None and settings.scale is not None and frame.pixel is not None:
        _require_equal(
            "the size of a pixel",
            "leave --scale out if the header is right, else export the vectors in pixels",
            Statement(pixel, units.shown(pixel, "m/px"), "the header"),
            Statement(frame.pixel, settings.scale, "--scale"),
        )
    if delay is not None and frame.delay is not None:
        _delay(fields, settings, frame.delay, delay)
    _interval(fields, settings, frame)
    _units(fields, settings)


def _delay(fields: VectorFields, settings: Settings, given: float, stated: float) -> None:
    """The time between the images of a pair, `given` by a flag and `stated` by the header."""
    never = stated == NEVER_SET
    if never and units.has(settings.velocity_unit or fields.velocity_unit, "frame"):
        return
    flag = "--frame-rate" if settings.pulse_delay is None else "--pulse-delay"
    shown = units.shown(stated, "s")
    _require_equal(
        "the time between the two images of a pair",
        f'give --pulse-delay "{shown}" for double frames if the header is right, '
        + "--velocity-unit m/frame if its time was never set, " * never
        + "or export the vectors in pixels if it is wrong",
        Statement(stated, shown + " (exactly 1, so probably never set)" * never, "the header"),
        Statement(given, units.shown(given, "s"), f"{flag} (you)"),
    )


def _interval(fields: VectorFields, settings: Settings, frame: Frame) -> None:
    unit = settings.time_unit or fields.time_unit
    times = np.unique(fields.t)
    interval = frame.interval
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


def _units(fields: VectorFields, settings: Settings) -> None:
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
