"""JSON and records: strict text, plain values of records, and back by cattrs."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Callable, Mapping
from typing import Any, Literal, NoReturn, TypeVar, get_args, get_origin

from cattrs import ClassValidationError, Converter, IterableValidationError
from cattrs.errors import AttributeValidationNote, ForbiddenExtraKeysError
from cattrs.gen import make_dict_structure_fn, mapping_structure_factory

from granpinn.declared import NUMBERS, WrongTypeError, typed
from granpinn.results.parameters import Named

T = TypeVar("T")
CONVERTER = Converter(forbid_extra_keys=True)


def decoded(content: Any, kind: type[T], name: str = "") -> T:
    """A record from the content of JSON, which has every field without a default, and no other.

    Args:
        name: of the content, for the message; "": it has none.

    Raises:
        WrongTypeError: the message is one sentence that names the place.
    """
    try:
        return CONVERTER.structure(content, kind)
    except (ValueError, TypeError, ClassValidationError, IterableValidationError) as error:
        raise WrongTypeError(_sentence(error, name)) from None


def _sentence(error: BaseException, place: str) -> str:
    """The first fault of an error, with its place."""
    while isinstance(error, ClassValidationError | IterableValidationError):
        placed, others = error.group_exceptions()
        if not placed:
            error = others[0]
            break
        error, note = placed[0]
        key = note.name if isinstance(note, AttributeValidationNote) else note.index
        place += f"[{key}]" if isinstance(key, int) else f".{key}" if place else str(key)
    if isinstance(error, KeyError):
        return f"{place} is missing"
    if isinstance(error, ForbiddenExtraKeysError):
        known = ", ".join(f.name for f in dataclasses.fields(error.cl))
        key = min(error.extra_fields)
        return f"{f'{place}.' if place else ''}{key} is not known; expected {known}"
    if isinstance(error, WrongTypeError):
        return f"{place or 'the content'} {error}"
    return f"{place}: {error}" if place else str(error)


def _origin(kind: Any) -> Any:
    return get_origin(kind)


def _of(kind: Any) -> Callable[[Any, Any], Any]:
    """The value as its type; the message begins behind the name of its place."""

    def structure(value: Any, own: Any) -> Any:
        try:
            return typed(value, kind or own, "")
        except WrongTypeError as error:
            raise WrongTypeError(str(error).removeprefix("the content").strip()) from None

    return structure


def _within(kind: Any, structure: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """The structure of a value that must be a dict or a list."""
    return lambda value, own: structure(_of(kind)(value, None), own)


for _kind in (*NUMBERS, str):
    CONVERTER.register_structure_hook(_kind, _of(None))
CONVERTER.register_structure_hook_func(lambda kind: _origin(kind) is Literal, _of(None))


@CONVERTER.register_structure_hook_factory(dataclasses.is_dataclass)
def _record(kind: Any) -> Callable[..., Any]:
    return _within(dict, make_dict_structure_fn(kind, CONVERTER))


@CONVERTER.register_structure_hook_factory(lambda kind: _origin(kind) is dict)
def _items(kind: Any) -> Callable[..., Any]:
    return _within(dict, mapping_structure_factory(kind, CONVERTER))


@CONVERTER.register_structure_hook_factory(lambda kind: _origin(kind) is tuple)
def _tuple(kind: Any) -> Callable[..., Any]:
    """All items of a tuple in a record have one type."""
    item, *more = get_args(kind)
    length = None if more == [...] else 1 + len(more)

    def structure(value: Any, _: Any) -> Any:
        if isinstance(value, list | tuple) and length in (None, len(value)):
            return tuple(CONVERTER.structure(value, list[item]))  # type: ignore[valid-type]
        return _of(kind)(value, None)  # it refuses the value

    return structure


@CONVERTER.register_structure_hook_factory(lambda k: isinstance(k, type) and issubclass(k, Named))
def _by_name(kind: Any) -> Callable[..., Any]:
    (item,) = get_args(kind.__orig_bases__[0])

    def structure(value: Any, _: Any) -> Any:
        return kind(CONVERTER.structure(value, dict[str, item]))  # type: ignore[valid-type]

    return structure


def parsed(text: str | bytes) -> Any:
    """The content of strict JSON; ValueError for any other text."""
    try:
        return json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except RecursionError as error:
        raise ValueError(str(error)) from None


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number, expected null")


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _refuse(text)


def plain(value: Any) -> Any:
    """JSON values alone of records, paths, and scalars and arrays of NumPy and torch.

    A number that is not finite becomes None.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
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
    raise TypeError(f"JSON holds plain values only, got {type(value).__name__}: {value!r}")
