"""Settings as text: values of the command line, and TOML files.

The word `none` stands for "no value", in TOML too, which has no word of its own for it.
"""

from __future__ import annotations

import json
import math
import tomllib
import types
import typing
from pathlib import Path
from typing import Any

from granpinn.config.settings import Config, ConfigError, flatten, kinds_of

NONE = "none"


def convert(value: Any, kind: Any, name: str) -> Any:
    """`value`, text or a TOML value, as `kind`; `name` is for the message."""
    if isinstance(kind, types.UnionType):
        (inner,) = (k for k in typing.get_args(kind) if k is not types.NoneType)
        return None if value in (None, NONE) else convert(value, inner, name)
    if typing.get_origin(kind) is typing.Literal:
        choices = typing.get_args(kind)
        if value not in choices:
            raise _wrong(name, f"one of {', '.join(choices)}", value)
        return value
    if typing.get_origin(kind) is tuple:
        items = value.strip("[]() ").split(",") if isinstance(value, str) else value
        if not isinstance(items, list | tuple):
            raise _wrong(name, "whole numbers separated by commas, such as 128,128", value)
        return tuple(convert(item, typing.get_args(kind)[0], name) for item in items)
    if kind is bool or kind is str:
        if not isinstance(value, kind):
            raise _wrong(name, "true or false" if kind is bool else "text", value)
        return value
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if math.isnan(number):
        raise _wrong(name, "a whole number" if kind is int else "a number", value)
    if kind is float:
        return number
    if not number.is_integer():
        raise _wrong(name, "a whole number", value)
    return int(number) if abs(number) < 2**53 else int(value)


def _wrong(name: str, expected: str, value: Any) -> ConfigError:
    return ConfigError(f"{name} must be {expected}, got {value!r}")


def read_toml(path: Path) -> dict[str, Any]:
    """Dotted settings of a TOML file."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path} does not exist: --config expects a TOML file") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} could not be read as TOML: {error}") from None
    kinds = kinds_of(Config)
    values: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            values |= {f"{key}.{inner}": item for inner, item in value.items()}
        else:
            values[key] = value
    for key, value in values.items():
        if key not in kinds:
            raise ConfigError(f"{path} has the unknown setting {key}: --help lists them all")
        values[key] = convert(value, kinds[key], f"{path}: {key}")
    return values


def to_toml(config: Config) -> str:
    """The TOML text that `read_toml` and `build` turn into the same Config."""
    lines = ["# Settings of this run; python -m granpinn.train --config FILE takes them again."]
    section = ""
    for key, value in flatten(config).items():
        head, _, name = key.rpartition(".")
        if head != section:
            lines += ["", f"[{head}]"]
            section = head
        lines.append(f"{name} = {_toml_value(value)}")
    return "\n".join(lines) + "\n"


def _toml_value(value: Any) -> str:
    if value is None:
        return f'"{NONE}"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
