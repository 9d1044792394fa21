"""Values against their declared types: arguments, fields of records and settings.

A wrong type ends in one sentence where it is given, before anything is computed with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import os
import types
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
from typing import (
    Any,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
import numpy.typing as npt

from granpinn.arrays import plain_array
from granpinn.errors import BadInput

LONGEST = 200  # characters of a value in a message
P = ParamSpec("P")
R = TypeVar("R")

WORDS = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "text",
    dict: "a dict with names as keys",
    Mapping: "a dict with names as keys",
    types.NoneType: "None",
    np.ndarray: "a NumPy array",
    Callable: "a function",
    os.PathLike: "a path",
}
SHOWN = (types.NoneType, bool, int, float, str, list, tuple, dict)  # by value, others by type
ORDERED = (tuple, list, Sequence)
REMEDIES = {
    "ndarray": "numpy.asarray makes one, of a torch tensor after .detach().cpu()",
    "Sequence": "put a single one in a list",
    "Config": "granpinn.Config(**settings) makes one of a dict",
    "Path": "pathlib.Path makes one of text",
}
_types = functools.cache(get_type_hints)
_signature = functools.cache(inspect.signature)


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with arguments of other types than it declares refused.

    Raises:
        BadInput: an argument has another type; the message is one sentence.
    """
    owner = function.__qualname__.removesuffix(".__init__")

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        given = _signature(function).bind(*args, **kwargs).arguments
        for name, kind in _types(function).items():
            if name in given and name not in ("return", *_collected(function)):
                _require(given[name], kind, name, owner, BadInput)
        return function(*args, **kwargs)

    return call


def require_fields(record: Any, error: type[BadInput] = BadInput) -> None:
    """Refuse a dataclass that holds a value of another type than its field declares.

    A masked array becomes a plain one in the record, with NaN under its mask.

    Raises:
        error: the sentence about the first such field.
    """
    owner: Any = type(record)
    for f in dataclasses.fields(owner):
        value, title = getattr(record, f.name), f"{owner.__name__}.{f.name}"
        if np.ma.isMaskedArray(value):
            value = plain_array(value, title, error)
            object.__setattr__(record, f.name, value)
        _require(value, _types(owner)[f.name], title, owner.__name__, error)


def _require(value: Any, kind: Any, name: str, owner: str, error: type[BadInput]) -> None:
    """Refuse a value of another type; the help of `owner` explains it."""
    try:
        typed(value, kind, name)
    except WrongTypeError as wrong:
        whole = str(wrong).startswith(f"{name} ")  # not an item of it
        names = [(get_origin(part) or part).__name__ for part in _parts(kind) if whole]
        advice = next((REMEDIES[k] for k in names if k in REMEDIES), f"help({owner}) explains it")
        raise error(f"{wrong}: {advice}") from None


class WrongTypeError(BadInput):
    """A value has another type than its place declares."""


def typed(value: Any, kind: Any, name: str) -> Any:
    """A value as its declared type: a list becomes a tuple, a whole number a float.

    Args:
        name: of the value, for the message; "": it has none.

    Raises:
        WrongTypeError: the message is one sentence that names the place.
    """
    origin, inner = get_origin(kind) or kind, get_args(kind)
    is_class = isinstance(origin, type)

    if kind is Any or kind == npt.ArrayLike:
        return value
    if len(parts := _parts(kind)) > 1:
        return _one_of(value, parts, name)
    if kind in NUMBERS:
        if (number := NUMBERS[kind](value)) is not None:
            return number
    elif origin is Literal:
        if isinstance(value, str) and value in inner:
            return value
    elif origin in ORDERED:
        if _ordered(value):
            if origin is tuple and inner[-1] is not ... and len(value) != len(inner):
                raise WrongTypeError(f"{name} must be a list of {len(inner)}, got {shown(value)}")
            return tuple(typed(one, inner[0], f"{name}[{k}]") for k, one in enumerate(value))
    elif origin in (dict, Mapping):
        if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            return value
    elif not is_class or isinstance(value, origin):  # nothing is known of what is no class
        return value
    raise WrongTypeError(f"{name or 'the content'} must be {words(kind)}, got {shown(value)}")


def _one_of(value: Any, kinds: Sequence[Any], name: str) -> Any:
    """A value as one of several types; None needs no words where it is one of them."""
    some = [kind for kind in kinds if kind is not types.NoneType]
    if value is None and len(some) < len(kinds):
        return None
    if len(some) == 1:
        return typed(value, some[0], name)
    for kind in some:
        with contextlib.suppress(WrongTypeError):
            return typed(value, kind, name)
    raise WrongTypeError(f"{name} must be {' or '.join(map(words, some))}, got {shown(value)}")


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    with contextlib.suppress(OverflowError):  # a whole number beyond float64
        return float(value)
    return None


def _whole(value: Any) -> int | None:
    return None if isinstance(value, bool) or not isinstance(value, Integral) else int(value)


def _truth(value: Any) -> bool | None:
    return bool(value) if isinstance(value, bool | np.bool_) else None


NUMBERS: dict[Any, Callable[[Any], Any]] = {float: _number, int: _whole, bool: _truth}


def _ordered(value: Any) -> bool:
    text = isinstance(value, str | bytes | bytearray)
    array = isinstance(value, np.ndarray) and value.ndim == 1
    return array or (isinstance(value, Sequence) and not text)


def shown(value: Any) -> str:
    """A value on one line, or its type if it is none of Python."""
    if not isinstance(value, SHOWN):
        return type(value).__name__
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def words(kind: Any) -> str:
    """A declared type in words."""
    origin, inner = get_origin(kind) or kind, get_args(kind)
    if origin is Literal:
        return f"one of {', '.join(inner)}"
    if origin in ORDERED:
        return f"a list, each item {words(inner[0])}"
    if isinstance(origin, type) and issubclass(origin, dict):
        return WORDS[dict]
    return WORDS.get(origin) or f"a {origin.__name__}"


def _parts(kind: Any) -> tuple[Any, ...]:
    """The types of a union, or the one type."""
    return tuple(get_args(kind)) if get_origin(kind) in (Union, types.UnionType) else (kind,)


@functools.cache
def _collected(function: Callable[..., Any]) -> tuple[str, ...]:
    """The names of *args and **kwargs of a function."""
    parameters = _signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD))
