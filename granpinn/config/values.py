"""Values of settings: their types, and how text becomes a value."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any, Literal, get_args, get_origin

from granpinn.config.fields import ConfigError, without_none
from granpinn.declared import shown

LARGEST = 10**300  # of a whole number; a float can hold it
NONE = "none"  # "no value" in text, and in TOML, which has no word for it


def typed(value: Any, kind: Any, name: str) -> Any:
    """`value` as `kind`: a list becomes a tuple, an int a float.

    ConfigError where it has another type; `name` is for the message.
    """
    kind, optional = without_none(kind)
    if optional and value is None:
        return None
    if get_origin(kind) is tuple:
        if not isinstance(value, list | tuple):
            raise _wrong(name, kind, value)
        return tuple(typed(item, get_args(kind)[0], name) for item in value)
    if get_origin(kind) is Literal:
        fits = isinstance(value, str) and value in get_args(kind)
    elif kind in (int, float):
        number = isinstance(value, Integral if kind is int else Real)
        huge = isinstance(value, Integral) and abs(int(value)) > LARGEST
        fits = number and not isinstance(value, bool) and not huge and not math.isnan(value)
        value = kind(value) if fits else value
    else:
        fits = isinstance(value, kind)
    if not fits:
        raise _wrong(name, kind, value)
    return value


def convert(text: str | bool, kind: Any, name: str) -> Any:
    """The value of type `kind` that `text` stands for; `name` is for the message of ConfigError.

    A flag without a value comes as True, and stays so.
    """
    inner, optional = without_none(kind)
    if optional and text == NONE:
        return None
    if isinstance(text, bool):
        return typed(text, inner, name)
    if get_origin(inner) is tuple:
        item = get_args(inner)[0]
        return tuple(convert(word, item, name) for word in text.strip("[]() ").split(","))
    value: Any = text
    try:
        if inner is float:
            value = number(text)
        elif inner is int:
            value = whole(text)
        elif inner is bool:
            value = {"true": True, "false": False}.get(text, text)
    except (ValueError, OverflowError):
        pass  # `typed` refuses the text
    return typed(value, inner, name)


def number(text: str) -> float:
    """The number of a text in ASCII; ValueError for other text, such as "1_000" or other digits."""
    if not text.isascii() or "_" in text:
        raise ValueError(f"no plain number: {text!r}")
    return float(text)


def whole(text: str) -> int:
    """The integer of "40000" or "4e4"; ValueError for other text."""
    value = number(text)
    if not value.is_integer():
        raise ValueError(f"no whole number: {text!r}")
    return int(value) if abs(value) < 2**53 else int(text)


def _wrong(name: str, kind: Any, value: Any) -> ConfigError:
    if get_origin(kind) is tuple:
        whole = get_args(kind)[0] is int
        expected = "whole numbers separated by commas, such as 128,128"
        expected = expected if whole else "numbers separated by commas, such as 0.3,0.6"
    elif get_origin(kind) is Literal:
        expected = f"one of {', '.join(get_args(kind))}"
    else:
        words = {bool: "true or false", str: "text", int: "a whole number", float: "a number"}
        expected = words[kind]
    return ConfigError(f"{name} must be {expected}, got {shown(value)}")
