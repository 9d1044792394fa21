"""Values against their declared types: arguments of public functions, and fields of records.

A wrong type ends in one sentence where it is given, before anything is computed with it.
"""

from __future__ import annotations

import collections.abc
import dataclasses
import functools
import inspect
import os
import types
from collections.abc import Callable, Sequence
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from granpinn.arrays import plain_array
from granpinn.errors import BadInput

LONGEST = 200  # characters of a value in a message
P = ParamSpec("P")
R = TypeVar("R")

NUMBERS = {
    float: (int, float, np.integer, np.floating),
    int: (int, np.integer),
    bool: (bool, np.bool_),
}
WORDS = {float: "a number", int: "a whole number", bool: "True or False", str: "text"}
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
                require(given[name], kind, name, owner)
        return function(*args, **kwargs)

    return call


def require_fields(record: Any, error: type[BadInput] = BadInput) -> None:
    """Refuse a dataclass that holds a value of another type than its field declares.

    A masked array becomes a plain one in the record, with NaN under its mask.

    Raises:
        error: the sentence about the first such field.
    """
    owner: Any = type(record)
    for name, kind in _types(owner).items():
        if name not in _fields(owner):
            continue
        value, title = getattr(record, name), f"{owner.__name__}.{name}"
        if np.ma.isMaskedArray(value):
            value = plain_array(value, title, error)
            object.__setattr__(record, name, value)
        require(value, kind, title, owner.__name__, error)


def require(value: Any, kind: Any, name: str, owner: str, error: type[BadInput] = BadInput) -> None:
    """Refuse a value of another type.

    Args:
        name: of the value, for the message.
        owner: the function or class whose help explains the value.
    """
    if fits(value, kind):
        return
    found = "None" if value is None else type(value).__name__
    if isinstance(value, str | bool | int | float):
        found += f" {str(value)[:40]!r}" if isinstance(value, str) else f" {value}"
    names = [(get_origin(part) or part).__name__ for part in _parts(kind)]
    advice = next((REMEDIES[k] for k in names if k in REMEDIES), f"help({owner}) explains it")
    raise error(f"{name} must be {words(kind)}, got {found}: {advice}")


def shown(value: Any) -> str:
    """A value on one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a declared type; lengths, and types that are no class, do not count."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any or kind == npt.ArrayLike:
        return True
    if origin in (Union, types.UnionType):
        return any(fits(value, part) for part in inner)
    if kind in (None, types.NoneType):
        return value is None
    if kind in NUMBERS:
        return isinstance(value, NUMBERS[kind]) and (kind is bool or not isinstance(value, bool))
    if origin is Literal:
        return isinstance(value, str) and value in inner
    if origin in (tuple, list, collections.abc.Sequence):
        ordered = isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim == 1)
        text = isinstance(value, str | bytes | bytearray)
        return ordered and not text and all(fits(item, inner[0]) for item in value)
    if origin in (dict, collections.abc.Mapping):
        return isinstance(value, collections.abc.Mapping) and all(fits(k, inner[0]) for k in value)
    if origin is collections.abc.Callable:
        return callable(value)
    kind = origin or kind
    return not isinstance(kind, type) or isinstance(value, kind)


def words(kind: Any) -> str:
    """A declared type in words."""
    if kind == npt.ArrayLike:
        return "an array"
    return " or ".join(dict.fromkeys(_word(part) for part in _parts(kind)))


def _word(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Literal:
        return ", ".join(map(repr, inner))
    if origin in (tuple, list, collections.abc.Sequence):
        return f"a sequence, each item {words(inner[0])}"
    named = {
        types.NoneType: "None",
        np.ndarray: "a NumPy array",
        dict: "a dict with names as keys",
        collections.abc.Mapping: "a dict with names as keys",
        collections.abc.Callable: "a function",
        os.PathLike: "a path",
    }
    return WORDS.get(kind) or named.get(origin or kind) or f"a {(origin or kind).__name__}"


def _parts(kind: Any) -> tuple[Any, ...]:
    """The types of a union, or the one type."""
    union = get_origin(kind) in (Union, types.UnionType)
    return tuple(get_args(kind)) if union else (kind,)


@functools.cache
def _fields(owner: type) -> frozenset[str]:
    return frozenset(f.name for f in dataclasses.fields(owner))


@functools.cache
def _collected(function: Callable[..., Any]) -> tuple[str, ...]:
    """The names of *args and **kwargs of a function."""
    parameters = _signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD))
