"""JSON values into typed dataclasses, strictly, and back.

Exactly the types that results.json needs: dataclasses, `Named`, float, int, bool, str, `X | None`,
tuples, dict[str, X] and Any.  An unknown key, a missing key or a wrong type is a ValueError that
names the place, the expected type and the found value.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from typing import Any, TypeVar

from granpinn.results.named import Named

T = TypeVar("T")


OTHERS = {"others": True}  # metadata of a dict field: the keys of the JSON object without a field


def encode(value: Any) -> Any:
    """The inverse of `decode`, with tuples as lists."""
    if dataclasses.is_dataclass(value):
        content: dict[str, Any] = {}
        for f in dataclasses.fields(value):
            item = encode(getattr(value, f.name))
            content |= item if "others" in f.metadata else {f.name: item}
        return content
    if isinstance(value, dict):
        return {name: encode(item) for name, item in value.items()}
    return [encode(item) for item in value] if isinstance(value, (list, tuple)) else value


def decode(cls: type[T], value: Any, where: str = "") -> T:
    """An instance of the dataclass `cls` from a dict of JSON values; `where`: its place."""
    return typing.cast(T, _decode(cls, value, where))


def _decode(kind: Any, value: Any, where: str) -> Any:
    if kind is Any:
        return value
    if dataclasses.is_dataclass(kind):
        return _dataclass(typing.cast(type, kind), value, where)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        (inner,) = (argument for argument in arguments if argument is not types.NoneType)
        return None if value is None else _decode(inner, value, where)
    if origin is tuple:
        return _tuple(arguments, value, where)
    if origin is dict:
        return _items(arguments[1], value, where)
    if issubclass(kind, Named):
        (inner,) = typing.get_args(kind.__orig_bases__[0])
        return _made(kind, (_items(inner, value, where),), {}, f"{where}.")
    return _scalar(kind, value, where)


def _items(kind: Any, value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _wrong(where, "an object", value)
    return {k: _decode(kind, item, f"{where}.{k}") for k, item in value.items()}


def _dataclass(cls: type, value: Any, where: str) -> Any:
    if not isinstance(value, dict):
        raise _wrong(where, "an object", value)
    fields = {f.name: f for f in dataclasses.fields(cls)}
    prefix = f"{where}." if where else ""
    for name, f in fields.items():
        if "others" in f.metadata:
            value = {k: v for k, v in value.items() if k in fields} | {
                name: {k: v for k, v in value.items() if k not in fields}
            }
    for key in value:
        if key not in fields:
            raise ValueError(f"{prefix}{key} is not known; expected {', '.join(fields)}")
    hints = typing.get_type_hints(cls)
    decoded = {}
    for name, f in fields.items():
        if name in value:
            place = where if "others" in f.metadata else prefix + name
            decoded[name] = _decode(hints[name], value[name], place)
        elif f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING:
            raise ValueError(f"{prefix}{name} is missing")
    return _made(cls, (), decoded, f"{where}: " if where else "")


def _made(cls: type, values: tuple[Any, ...], named: dict[str, Any], prefix: str) -> Any:
    try:
        return cls(*values, **named)
    except ValueError as error:
        raise ValueError(f"{prefix}{error}") from None


def _tuple(arguments: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, (list, tuple)):
        raise _wrong(where, "a list", value)
    if arguments[-1] is Ellipsis:
        arguments = arguments[:1] * len(value)
    if len(arguments) != len(value):
        raise _wrong(where, f"a list of {len(arguments)}", value)
    pairs = zip(arguments, value, strict=True)
    return tuple(_decode(kind, item, f"{where}[{i}]") for i, (kind, item) in enumerate(pairs))


def _scalar(kind: type, value: Any, where: str) -> Any:
    accepted: Any = {float: (int, float), int: int, bool: bool, str: str}[kind]
    expected = {float: "a finite number", int: "a whole number", bool: "true or false"}
    wrong = _wrong(where, expected.get(kind, "a string"), value)
    if not isinstance(value, accepted) or isinstance(value, bool) != (kind is bool):
        raise wrong
    if kind is not float:
        return value
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond the range of float64
        finite = False
    if not finite:
        raise wrong
    return float(value)


def _wrong(where: str, expected: str, value: Any) -> ValueError:
    return ValueError(f"{where or 'the content'} must be {expected}, got {value!r}")
