"""Records as JSON values and back, strictly, by cattrs.

An unknown key, a missing key or a wrong type is a ValueError that names the place. A whole number
is a number, and nothing else is converted.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from cattrs import ClassValidationError, Converter, IterableValidationError
from cattrs.errors import AttributeValidationNote, ForbiddenExtraKeysError
from cattrs.gen import make_dict_structure_fn, mapping_structure_factory

from granpinn.regular import read_text
from granpinn.results.parameters import Named

T = TypeVar("T")
CONVERTER = Converter(forbid_extra_keys=True)


class WrongTypeError(ValueError):
    """A value has another type; the message begins behind the name of its place."""

    def __init__(self, expected: str, value: Any) -> None:
        super().__init__(f"must be {expected}, got {value!r}")


def encode(value: Any) -> Any:
    """The inverse of `decode`."""
    return CONVERTER.unstructure(value)


def decode(cls: type[T], value: Any, where: str = "") -> T:
    """An instance of `cls` from JSON values; `where`: their place, for the message.

    Raises:
        ValueError: the values do not fit.
    """
    try:
        return CONVERTER.structure(value, cls)
    except (ValueError, TypeError, ClassValidationError, IterableValidationError) as error:
        raise ValueError(_sentence(error, where)) from None


def _sentence(error: BaseException, where: str) -> str:
    """The first fault of an error, with its place."""
    kind: Any = None
    while isinstance(error, ClassValidationError | IterableValidationError):
        placed, others = error.group_exceptions()
        if not placed:
            error = others[0]
            break
        error, note = placed[0]
        kind = note.type
        key = note.name if isinstance(note, AttributeValidationNote) else note.index
        where += f"[{key}]" if isinstance(key, int) else f".{key}" if where else str(key)
    if isinstance(error, KeyError):
        return f"{where} is missing"
    if isinstance(error, ForbiddenExtraKeysError):
        known = ", ".join(f.name for f in dataclasses.fields(error.cl))
        key = min(error.extra_fields)
        return f"{f'{where}.' if where else ''}{key} is not known; expected {known}"
    if isinstance(error, WrongTypeError):
        return f"{where or 'the content'} {error}"
    if isinstance(error, AttributeError | TypeError):
        return f"{where or 'the content'} must be a value of the type {kind}"
    return f"{where}: {error}" if where else str(error)


def _strict(kind: type, expected: str) -> None:
    def structure(value: Any, _: Any) -> Any:
        if type(value) is not kind:
            raise WrongTypeError(expected, value)
        return value

    CONVERTER.register_structure_hook(kind, structure)


_strict(int, "a whole number")
_strict(bool, "true or false")
_strict(str, "a string")


@CONVERTER.register_structure_hook
def _number(value: Any, _: Any) -> float:
    try:
        if type(value) in (int, float) and math.isfinite(value):
            return float(value)
    except OverflowError:  # a whole number beyond the range of float64
        pass
    raise WrongTypeError("a finite number", value)


def _origin(kind: Any) -> Any:
    return typing.get_origin(kind)


def _typed(expected: Any, words: str, inner: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    def structure(value: Any, kind: Any) -> Any:
        if not isinstance(value, expected):
            raise WrongTypeError(words, value)
        return inner(value, kind)

    return structure


@CONVERTER.register_structure_hook_factory(dataclasses.is_dataclass)
def _record(kind: Any) -> Callable[..., Any]:
    return _typed(dict, "an object", make_dict_structure_fn(kind, CONVERTER))


@CONVERTER.register_structure_hook_factory(lambda kind: _origin(kind) is typing.Literal)
def _word(kind: Any) -> Callable[..., Any]:
    def structure(value: Any, _: Any) -> Any:
        if value not in (words := typing.get_args(kind)):
            raise WrongTypeError(f"one of {', '.join(words)}", value)
        return value

    return structure


@CONVERTER.register_structure_hook_factory(lambda kind: _origin(kind) is dict)
def _items(kind: Any) -> Callable[..., Any]:
    return _typed(dict, "an object", mapping_structure_factory(kind, CONVERTER))


@CONVERTER.register_structure_hook_factory(lambda kind: _origin(kind) is tuple)
def _tuple(kind: Any) -> Callable[..., Any]:
    """All items of a tuple in a record that is read have one type."""
    item, *more = typing.get_args(kind)
    length = None if more == [Ellipsis] else 1 + len(more)

    def structure(value: Any, _: Any) -> Any:
        if length not in (None, len(value)):
            raise WrongTypeError(f"a list of {length}", value)
        return tuple(CONVERTER.structure(value, list[item]))  # type: ignore[valid-type]

    return _typed((list, tuple), "a list", structure)


@CONVERTER.register_structure_hook_factory(lambda k: isinstance(k, type) and issubclass(k, Named))
def _by_name(kind: Any) -> Callable[..., Any]:
    (item,) = typing.get_args(kind.__orig_bases__[0])

    def structure(value: Any, _: Any) -> Any:
        return kind(CONVERTER.structure(value, dict[str, item]))  # type: ignore[valid-type]

    return _typed(dict, "an object", structure)


def read_json(path: Path) -> Any:
    """The content of a regular file with strict JSON.

    Raises:
        UnsafeFileError: as `read_text`.
        ValueError: the text is no strict JSON.
    """
    return parsed(read_text(path))


def parsed(text: str | bytes) -> Any:
    """The content of strict JSON; ValueError for any other text."""
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except RecursionError as error:
        raise ValueError(str(error)) from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number, expected null")


def plain(value: Any) -> Any:
    """JSON values only: NumPy and torch scalars and arrays, paths and tuples are converted."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, os.PathLike):
        return plain(os.fspath(value))
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):  # a file name may hold bytes that are not UTF-8; JSON cannot
        return value.encode(errors="backslashreplace").decode()
    if value is None or isinstance(value, (bool, int)):
        return value
    raise TypeError(f"results.json holds plain values only, got {type(value).__name__}: {value!r}")
