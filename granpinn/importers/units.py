"""Conversion of text with units, such as "0.12 mm/px", to plain SI numbers, by pint.

Pixel and frame are units here. A velocity in px/frame needs a scale (m/px) and a time between
frames (s/frame) to become m/s, and an error can name the missing one.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

from granpinn.data.flow import LARGEST, LEAST
from granpinn.importers.vectors import MAX_UNIT, DataFileError

# A number has at most 64 ASCII characters. Python alone would also accept "1_000", digits of other
# scripts, and integers of any length, whose conversion takes quadratic time.
MAX_NUMBER = 64
MAX_QUANTITY = MAX_NUMBER + MAX_UNIT
_QUANTITY = re.compile(r"([+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?)(.*+)")
# Only plain products and quotients of names with one-digit powers, which are quick to parse.
_POWER = r"(?:\^|\*\*)?-?[0-9]"
_NAME = rf"[A-Za-zµμ°]++(?:{_POWER})?"
_UNIT = re.compile(rf"(?:1 ?/ ?)?{_NAME}(?:(?: ?[*/·] ?| ){_NAME}){{0,5}}")
_NAME_WITH_POWER = re.compile(rf"([A-Za-zµμ°])({_POWER})")

# Quantities with their dimensions, and examples for messages.
DIMENSIONS = {
    "length": ("[length]", "'0.8 mm'"),
    "time": ("[time]", "'4 ms'"),
    "velocity": ("[length]/[time]", "'0.1 m/s'"),
    "acceleration": ("[length]/[time]**2", "'9.81 m/s^2'"),
    "density": ("[mass]/[length]**3", "'2500 kg/m^3'"),
    "pressure": ("[mass]/[length]/[time]**2", "'10 Pa'"),
    "angle": ("", "'1.2 deg'"),
}


def number(text: str, what: str) -> float:
    """A finite number; `what` names its place for the message.

    Raises:
        DataFileError: the text is no finite number.
    """
    stripped, value = text.strip(), math.nan
    if len(stripped) <= MAX_NUMBER and stripped.isascii() and "_" not in stripped:
        with suppress(ValueError):
            value = float(stripped)
    if not math.isfinite(value):
        raise DataFileError(f"{what} must be a finite number, got {text[:MAX_NUMBER]!r}")
    return value


def whole(text: str, what: str) -> int:
    """An integer; `what` names its place for the message.

    Raises:
        DataFileError: the text is no integer.
    """
    value = number(text, what)
    if value != int(value):
        raise DataFileError(f"{what} must be an integer, got {text[:MAX_NUMBER]!r}")
    return int(value)


@cache
def _registry() -> Any:
    import pint  # slow to import, and only readers need it

    registry: Any = pint.UnitRegistry(autoconvert_offset_to_baseunit=False)
    registry.define("px = [px_length] = pixel = pixels = Pixel = pix")
    registry.define("frame = [frame_count] = frames = fr")
    registry.define("fps = frame / second")
    return registry


def unit(text: str, what: str) -> Any:
    """A pint unit; `what` names the setting or the file for the message."""
    short = len(text) <= MAX_QUANTITY
    cleaned = " ".join(text.strip().strip("[]").split()) if short else text
    if cleaned in ("1", "-", ""):
        return _registry().dimensionless
    if len(cleaned) <= MAX_UNIT and _UNIT.fullmatch(cleaned):
        powers = _NAME_WITH_POWER.sub(lambda m: f"{m[1]}**{m[2].lstrip('^*')}", cleaned)
        try:
            return _registry().Unit(powers.replace("·", "*"))
        except Exception:  # of any kind, for names that pint does not know
            pass
    raise DataFileError(
        f"{what} must be a unit such as mm, px/frame or m/s, got {text[:MAX_QUANTITY]!r}"
    )


def split(text: str, what: str) -> tuple[float, str]:
    """Number and unit of text such as "2500 kg/m^3"."""
    match = _QUANTITY.fullmatch(" ".join(text.split())) if len(text) <= MAX_QUANTITY else None
    if match is None:
        raise DataFileError(f"{what} must be a number with a unit, got {text[:MAX_QUANTITY]!r}")
    return number(match[1], what), match[2].strip()


def in_range(value: float, what: str, text: str) -> float:
    """The value, which must be positive and usable in products; `text` is what was given."""
    if not value > 0:
        raise DataFileError(f"{what} must be positive, got {text!r}")
    if not LEAST <= value <= LARGEST:
        raise DataFileError(
            f"{what} must be between {LEAST:g} and {LARGEST:g} in SI units, got {text!r}: check "
            "the number and its unit"
        )
    return value


def scale(text: str) -> float:
    """Meters per pixel, from "0.12 mm/px" or "8.3 px/mm"."""
    expected = "a positive length per pixel such as '0.12 mm/px'"
    return _either_way_up(text, "--scale", expected, "m/px")


def frame_time(text: str, what: str) -> float:
    """Seconds per frame, from "500 Hz", "500 fps", "500 frame/s" or "2 ms"."""
    return _either_way_up(text, what, "a rate or a time such as '500 Hz' or '2 ms'", "s", "s/frame")


def _either_way_up(text: str, what: str, expected: str, *targets: str) -> float:
    """A positive quantity, or one over it, in the first target unit that it converts to."""
    size, name = split(text, what)
    value = size * unit(name, what)
    for candidate in (value, 1 / value if value.magnitude else value):
        for target in map(_registry().Unit, targets):
            # A frequency in hertz is 1/s, with no radians in it.
            if candidate.dimensionality == target.dimensionality and candidate.magnitude > 0:
                return in_range(float(candidate.to(target).magnitude), what, text)
    raise DataFileError(f"{what} must be {expected}, got {text!r}")


class Calibration(NamedTuple):
    """What makes SI numbers of those with units; None: unknown.

    Attributes:
        pixel: meters per pixel.
        delay, interval: seconds between the images of a pair, and between frames.
        dimensionless: whether numbers have no units.
    """

    pixel: float | None = None
    delay: float | None = None
    interval: float | None = None
    dimensionless: bool = False

    def factor(self, text: str, dimension: str, what: str) -> float:
        """The factor from a unit to SI.

        Raises:
            DataFileError: the unit has another dimension, or pixels or frames of unknown size.
        """
        frame = self.interval if dimension == "time" else self.delay
        if self.dimensionless:
            if text not in ("", "1", "-", "frame"):
                raise DataFileError(
                    f"{what} must be without a unit with --dimensionless, got {text}"
                )
            return frame if text == "frame" and frame is not None else 1.0
        registry = _registry()
        found = 1.0 * unit(text, what)
        dimensions = dict(found.dimensionality)
        for key, known, flag, base in (
            ("[px_length]", self.pixel, "--scale, such as '0.12 mm/px'", registry.m / registry.px),
            ("[frame_count]", frame, "--frame-rate, such as '500 Hz'", registry.s / registry.frame),
        ):
            if power := dimensions.get(key, 0):
                if known is None:
                    raise DataFileError(f"{what} is in {text}: give {flag}")
                found = found * (known * base) ** power
        if not found.check(DIMENSIONS[dimension][0]):
            raise DataFileError(f"{what} must be a unit of {dimension}, got {text!r}")
        return in_range(float(found.to_base_units().magnitude), what, text)

    def number(self, text: str, dimension: str, what: str) -> float:
        """A number with a unit in SI, an angle in radians; without units a plain number."""
        if self.dimensionless:
            return number(text, f"{what} with --dimensionless")
        value, name = split(text, what)
        if name in ("", "1", "-"):
            raise DataFileError(
                f"{what} must be in a unit of {dimension}, such as "
                f"{DIMENSIONS[dimension][1]}, got {text!r}"
            )
        return value * self.factor(name, dimension, what)

    def positive(self, text: str, dimension: str, what: str) -> float:
        """The same, of a number that must be positive and usable in products."""
        return in_range(self.number(text, dimension, what), what, text)


SI = Calibration()


def ratio(text: str, other: str, what: str) -> float:
    """How many units `other` are in one unit `text`; DataFileError if they do not convert."""
    one, base = 1.0 * unit(text, what), unit(other, what)
    if one.dimensionality != base.dimensionality:
        raise DataFileError(
            f"{what} must have a unit that converts to {other}, the unit of the columns before "
            f"it, got {text}: export both in one unit"
        )
    return in_range(float(one.to(base).magnitude), what, text)


def same_dimension(text: str, other: str) -> bool:
    """Whether a value in one unit can be converted to the other."""
    return _dimensions(text) == _dimensions(other)


def shown(value: float, name: str) -> str:
    """A value in `name`, with the prefix that suits its size: 0.002 s is "2 ms"."""
    return f"{(value * unit(name, 'the unit')).to_compact():.6g~P}"


def has(text: str | None, symbol: str) -> bool:
    """Whether a unit contains pixels ("px") or frames ("frame")."""
    key = {"px": "[px_length]", "frame": "[frame_count]"}[symbol]
    return text is not None and key in _dimensions(text)


def _dimensions(text: str) -> dict[str, float]:
    return dict(unit(text, "the unit").dimensionality)
