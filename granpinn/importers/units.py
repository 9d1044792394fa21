"""Conversion of text with units, such as "0.12 mm/px", to plain SI numbers.

Pixel and frame are units here. A velocity in px/frame needs a scale (m/px) and a time between
frames (s/frame) to become m/s, and an error can name the missing one.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from granpinn.importers.numerals import MAX_CHARACTERS as MAX_NUMBER
from granpinn.importers.numerals import number
from granpinn.importers.vectors import DataFileError
from granpinn.physics.unit_text import MAX_CHARACTERS as MAX_UNIT

MAX_QUANTITY = MAX_NUMBER + MAX_UNIT
_QUANTITY = re.compile(r"([+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?)(.*+)")
# Only plain products and quotients of names with one-digit powers, which are quick to parse.
_POWER = r"(?:\^|\*\*)?-?[0-9]"
_NAME = rf"[A-Za-zµμ°]++(?:{_POWER})?"
_UNIT = re.compile(rf"(?:1 ?/ ?)?{_NAME}(?:(?: ?[*/·] ?| ){_NAME}){{0,5}}")
_NAME_WITH_POWER = re.compile(rf"([A-Za-zµμ°])({_POWER})")
# Factors and constants of one unit system; what is larger or smaller is a mistake.
_LEAST, _MOST = 1e-30, 1e30

DIMENSIONS = {
    "length": "[length]",
    "time": "[time]",
    "velocity": "[length]/[time]",
    "acceleration": "[length]/[time]**2",
    "density": "[mass]/[length]**3",
    "pressure": "[mass]/[length]/[time]**2",
    "angle": "",
}


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
    import pint

    if len(text) > MAX_QUANTITY:
        raise DataFileError(
            f"{what} must be a unit such as mm, px/frame or m/s, got {len(text)} characters: "
            "give a short one"
        )
    cleaned = " ".join(text.strip().strip("[]").split())
    if cleaned in ("1", "-", ""):
        return _registry().dimensionless
    if len(cleaned) > MAX_UNIT or not _UNIT.fullmatch(cleaned):
        raise DataFileError(f"{what} must be a unit such as mm, px/frame or m/s, got {text!r}")
    powers = _NAME_WITH_POWER.sub(_with_power, cleaned).replace("·", "*")
    try:
        return _registry().Unit(powers)
    except (pint.errors.PintError, ValueError, TypeError, AttributeError, SyntaxError):
        raise DataFileError(
            f"{what} must be a unit such as mm, px/frame or m/s, got {text!r}, which is not known"
        ) from None


def _with_power(match: re.Match[str]) -> str:
    return f"{match[1]}**{match[2].lstrip('^*')}"


def split(text: str, what: str) -> tuple[float, str]:
    """Number and unit of text such as "2500 kg/m^3"."""
    if len(text) > MAX_QUANTITY:
        raise DataFileError(
            f"{what} must be a number with a unit, got {len(text)} characters: give a short one"
        )
    match = _QUANTITY.fullmatch(" ".join(text.split()))
    if match is None:
        raise DataFileError(f"{what} must be a number with a unit, got {text!r}")
    return number(match[1], what), match[2].strip()


def plain(text: str, what: str) -> float:
    """A number of a conversion without units."""
    try:
        return number(text, what)
    except DataFileError:
        raise DataFileError(
            f"{what} must be a plain number with --dimensionless, got {text!r}"
        ) from None


def positive(text: str, what: str) -> float:
    """A positive number of a conversion without units."""
    return in_range(plain(text, what), what, text)


def in_range(value: float, what: str, text: str) -> float:
    """The value, which must be positive and usable in products; `text` is what was given."""
    if not value > 0:
        raise DataFileError(f"{what} must be positive, got {text!r}")
    if not _LEAST <= value <= _MOST:
        raise DataFileError(
            f"{what} must be between {_LEAST:g} and {_MOST:g} in SI units, got {text!r}: check "
            "the number and its unit"
        )
    return value


def quantity(text: str, what: str) -> Any:
    """A pint quantity from text such as "2500 kg/m^3"."""
    value, name = split(text, what)
    return value * unit(name, what)


def si(text: str, dimension: str, what: str, example: str) -> float:
    """A number with a unit of the given dimension in SI; an angle in radians."""
    value = quantity(text, what)
    wanted = DIMENSIONS[dimension]
    if not value.check(wanted) or (dimension == "angle" and value.units == _registry().Unit("")):
        article = "an" if dimension.startswith("a") else "a"
        raise DataFileError(
            f"{what} must be {article} {dimension} with its unit, such as {example}, got {text!r}"
        )
    return float(value.to_base_units().magnitude)


def scale(text: str) -> float:
    """Meters per pixel, from "0.12 mm/px" or "8.3 px/mm"."""
    value = quantity(text, "--scale")
    registry = _registry()
    for candidate in (value, 1 / value if value.magnitude else value):
        if candidate.check("[length]/[px_length]") and candidate.magnitude > 0:
            found = float(candidate.to(registry.m / registry.px).magnitude)
            return in_range(found, "--scale", text)
    raise DataFileError(
        f"--scale must be a positive length per pixel such as '0.12 mm/px', got {text!r}"
    )


def frame_time(text: str, what: str) -> float:
    """Seconds per frame, from "500 Hz", "500 fps", "500 frame/s" or "2 ms"."""
    value = quantity(text, what)
    registry = _registry()
    for candidate in (value, 1 / value if value.magnitude else value):
        for target in (registry.s, registry.s / registry.frame):
            # A frequency in hertz is 1/s, with no radians in it.
            if candidate.dimensionality == target.dimensionality and candidate.magnitude > 0:
                return in_range(float(candidate.to(target).magnitude), what, text)
    raise DataFileError(f"{what} must be a rate or a time such as '500 Hz' or '2 ms', got {text!r}")


def factor(
    text: str,
    dimension: str,
    what: str,
    px: float | None = None,
    frame: float | None = None,
) -> float:
    """The factor from this unit to SI.

    Args:
        px: meters per pixel, None if unknown.
        frame: seconds per frame, None if unknown.

    Raises:
        DataFileError: the unit has another dimension, or pixels or frames of unknown size.
    """
    registry = _registry()
    found = 1.0 * unit(text, what)
    dimensions = dict(found.dimensionality)
    for key, known, flag, base in (
        ("[px_length]", px, "--scale, such as '0.12 mm/px'", registry.m / registry.px),
        ("[frame_count]", frame, "--frame-rate, such as '500 Hz'", registry.s / registry.frame),
    ):
        power = dimensions.get(key, 0)
        if power and known is None:
            raise DataFileError(f"{what} is in {text}: give {flag}")
        if power and known is not None:
            found = found * (known * base) ** power
    if not found.check(DIMENSIONS[dimension]):
        raise DataFileError(f"{what} must be a unit of {dimension}, got {text!r}")
    return in_range(float(found.to_base_units().magnitude), what, text)


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
    one, base = unit(text, "the unit"), unit(other, "the unit")
    return bool(one.dimensionality == base.dimensionality)


def shown(value: float, name: str) -> str:
    """A value in `name`, with the prefix that suits its size: 0.002 s is "2 ms"."""
    return f"{(value * unit(name, 'the unit')).to_compact():.6g~P}"


def has(text: str | None, symbol: str) -> bool:
    """Whether a unit contains pixels ("px") or frames ("frame")."""
    if text is None:
        return False
    key = {"px": "[px_length]", "frame": "[frame_count]"}[symbol]
    return key in dict(unit(text, "the unit").dimensionality)
