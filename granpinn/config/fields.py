"""A setting is a dataclass field that states its default, its help, its range and its choices.

Command line, TOML files, checks and messages read them from there.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import math
import types
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from granpinn.declared import WrongTypeError, shown, typed
from granpinn.errors import BadInput

C = TypeVar("C")

# The least positive number and the largest one: float32 holds both.
TINY, LARGEST = 1e-30, 1e30
NONE = "none"  # "no value" in text, and in TOML, which has no word for it


class ConfigError(BadInput):
    """A setting is missing, unknown or impossible; the message is one sentence."""


@dataclass(frozen=True)
class Setting:
    """What the field of a setting states.

    Attributes:
        kind: its type, such as `tuple[int, ...]` or `float | None`.
        default: its value in the default recipe.
        help: the sentence that explains it.
        low, high: range of a number, or of each number of a tuple; a `low` of TINY: above 0. An
            integer states its own.
        choices: the values that it may have; (): all of its type.
        free: a resumed run may have another value, since it changes no number of the training.
        group: heading of the flag in the help; of a setting in a section the section.
        metavar: placeholder of its value in the help; "": one for its type.
    """

    kind: Any
    default: Any
    help: str
    low: float = -LARGEST
    high: float = LARGEST
    choices: Collection[Any] = ()
    free: bool = False
    group: str = ""
    metavar: str = ""

    def check(self, value: Any, name: str) -> Any:
        """A value as the type of the setting; `name` is for the message.

        Raises:
            ConfigError: it has another type, or is outside of the choices or the range.
        """
        _, optional = without_none(self.kind)
        try:
            value = typed(
                None if optional and shown(value) == shown(NONE) else value, self.kind, name
            )
        except WrongTypeError as error:
            raise ConfigError(error.for_commands) from None
        if isinstance(value, str) and not value:
            raise ConfigError(f"{name} must not be empty: leave it out, or give a value")
        if self.choices and value not in self.choices:
            raise ConfigError(f"{name} must be {self.range_text}, got {shown(value)}")
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(x, int | float) and not self.low <= x <= self.high for x in numbers):
            raise ConfigError(
                f"{name} must be {self.range_text}, got {as_text(value)}: --help explains it"
            )
        return value

    def of_text(self, text: str | bool, name: str) -> Any:
        """The value that a text of a command line stands for; a flag without a value is True.

        Raises:
            ConfigError: as `check`.
        """
        return self.check(_of_text(text, self.kind), name)

    @property
    def range_text(self) -> str:
        """The choices or the range in words."""
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        if math.isinf(self.high):
            return f"at least {self.low:g}"
        if self.low == TINY:
            return f"positive and at most {self.high:g}"
        return f"in [{self.low:g}, {self.high:g}]"


def setting(default: Any, help: str, **stated: Any) -> Any:
    """A dataclass field that is a setting; `Setting` explains the arguments.

    The values of a Literal type are its choices without being written again.
    """
    return field(default=default, metadata={"help": help, **stated})


def most_like(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like `name`, which may lack its section; None without one."""
    names = {key: key for key in known}
    for key in [*names]:
        names.setdefault(key.rpartition(".")[2], key)
    for word in (name, name.replace("_", "-"), name.rpartition(".")[2]):
        if near := difflib.get_close_matches(word, names, n=1):
            return names[near[0]]
    return None


def unknown(name: str, known: Iterable[str], verb: str = "train") -> str:
    """The sentence about a setting that does not exist, with the nearest of the known names.

    Args:
        verb: the command that has the settings.
    """
    near = most_like(name, known)
    hint = f"did you mean {near}?" if near else f"granpinn {verb} --help lists them"
    return f"unknown setting {name}: {hint}"


@functools.cache
def sections_of(cls: type) -> dict[str, type]:
    """{"network": Network, ...}: the fields of a dataclass that are groups of settings."""
    kinds = get_type_hints(cls)
    return {
        f.name: kind
        for f in dataclasses.fields(cls)
        if isinstance(kind := kinds[f.name], type) and dataclasses.is_dataclass(kind)
    }


@functools.cache
def settings_of(cls: type) -> dict[str, Setting]:
    """{"network.widths": Setting(...), ...}: every setting of a dataclass by its dotted name."""
    kinds, sections = get_type_hints(cls), sections_of(cls)
    found: dict[str, Setting] = {}
    for f in dataclasses.fields(cls):
        if f.name in sections:
            for name, stated in settings_of(sections[f.name]).items():
                found[f"{f.name}.{name}"] = dataclasses.replace(stated, group=f.name)
            continue
        kind = kinds[f.name]
        found[f.name] = Setting(kind, f.default, **f.metadata)
        if get_origin(kind) is Literal:
            found[f.name] = dataclasses.replace(found[f.name], choices=get_args(kind))
    return found


def flatten(config: Any, prefix: str = "") -> dict[str, Any]:
    """{"network.widths": (128, 128, 128), ...}: the value of every setting by its dotted name.

    Args:
        config: a dataclass or a dict, with others in it.
    """
    flat: dict[str, Any] = {}
    names = config if isinstance(config, Mapping) else [f.name for f in dataclasses.fields(config)]
    for name in names:
        value = config[name] if isinstance(config, Mapping) else getattr(config, name)
        nested = dataclasses.is_dataclass(value) or isinstance(value, Mapping)
        flat |= flatten(value, f"{prefix}{name}.") if nested else {prefix + name: value}
    return flat


def flag_of(key: str) -> str:
    """The flag of a setting: `max_time` is --max-time; names inside a section stay as they are."""
    return "--" + (key if "." in key else key.replace("_", "-"))


def without_none(kind: Any) -> tuple[Any, bool]:
    """(T, True) for the type `T | None`, (T, False) for the type T."""
    if not isinstance(kind, types.UnionType):
        return kind, False
    (inner,) = (k for k in get_args(kind) if k is not types.NoneType)
    return inner, True


def _of_text(text: str | bool, kind: Any) -> Any:
    """What a text stands for; the text itself if it stands for nothing of the type."""
    inner, _ = without_none(kind)
    if isinstance(text, bool):
        return text
    if get_origin(inner) is tuple and text != NONE:
        item = get_args(inner)[0]
        return tuple(_of_text(word, item) for word in text.strip("[]() ").split(","))
    with contextlib.suppress(LookupError, ValueError, OverflowError):
        return READERS[inner](text)
    return text


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


READERS: dict[Any, Callable[[str], Any]] = {
    float: number,
    int: whole,
    bool: lambda text: {"true": True, "false": False}[text],
}


def as_text(value: Any) -> str:
    """A value as on the command line."""
    if value is None:
        return NONE
    return ",".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
