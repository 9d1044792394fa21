"""A setting is a dataclass field that states its default, its help, its range and its choices.

Command line, TOML files, checks and messages read them from there.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import types
from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from granpinn.declared import shown
from granpinn.errors import BadInput

C = TypeVar("C")

# The least positive number and the largest one: float32 holds both.
TINY, LARGEST = 1e-30, 1e30


class ConfigError(BadInput):
    """A setting is missing, unknown or impossible; the message is one sentence."""


@dataclass(frozen=True)
class Setting:
    """What the field of a setting states.

    Attributes:
        kind: its type, such as `tuple[int, ...]` or `float | None`.
        default: its value in the default recipe.
        help: the sentence that explains it.
        low, high: range of a number, or of each number of a tuple. An integer states its own.
        positive: a number must be above 0, which is a `low` of TINY.
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
    positive: bool = False
    choices: Collection[Any] = ()
    free: bool = False
    group: str = ""
    metavar: str = ""

    def check(self, value: Any, name: str) -> None:
        """Refuses a value outside of the choices or the range; `name` is for the message."""
        if isinstance(value, str) and not value:
            raise ConfigError(f"{name} must not be empty: leave it out, or give a value")
        if self.choices and not (isinstance(value, Hashable) and value in self.choices):
            raise ConfigError(f"{name} must be {self.range_text}, got {shown(value)}")
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(x, int | float) and not self._holds(x) for x in numbers):
            raise ConfigError(
                f"{name} must be {self.range_text}, got {_text(value)}: --help explains it"
            )

    def _holds(self, x: float) -> bool:
        return (TINY if self.positive else self.low) <= x <= self.high

    @property
    def range_text(self) -> str:
        """The choices or the range in words."""
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        if math.isinf(self.high):
            return f"at least {self.low:g}"
        if self.positive:
            return f"positive and at most {self.high:g}"
        return f"in [{self.low:g}, {self.high:g}]"


def setting(default: Any, help: str, **stated: Any) -> Any:
    """A dataclass field that is a setting; `Setting` explains the arguments.

    The values of a Literal type are its choices without being written again.
    """
    return field(default=default, metadata={"help": help, **stated})


def section(kind: type, *, free: bool = False) -> Any:
    """A dataclass field that is a group of settings; `free` holds for all of them."""
    return field(default_factory=kind, metadata={"free": free})


def most_like(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like `name`, which may lack its section; None without one."""
    names = {key: key for key in known}
    for key in [*names]:
        names.setdefault(key.rpartition(".")[2], key)
    for word in (name, name.replace("_", "-"), name.rpartition(".")[2]):
        if near := difflib.get_close_matches(word, names, n=1):
            return names[near[0]]
    return None


def unknown(shown: str, name: str, known: Iterable[str], verb: str = "train") -> str:
    """The sentence about a setting that does not exist, with the nearest of the known names.

    Args:
        verb: the command that has the settings.
    """
    near = most_like(name, known)
    hint = f"did you mean {near}?" if near else f"granpinn {verb} --help lists them"
    return f"unknown setting {shown}: {hint}"


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
                free = stated.free or f.metadata["free"]
                found[f"{f.name}.{name}"] = dataclasses.replace(stated, free=free, group=f.name)
            continue
        kind = kinds[f.name]
        found[f.name] = Setting(kind, f.default, **f.metadata)
        if get_origin(kind) is Literal:
            found[f.name] = dataclasses.replace(found[f.name], choices=get_args(kind))
    return found


def flatten(config: Any, prefix: str = "") -> dict[str, Any]:
    """{"network.widths": (128, 128, 128), ...}: the value of every setting by its dotted name."""
    flat: dict[str, Any] = {}
    for f in dataclasses.fields(config):
        value = getattr(config, f.name)
        nested = dataclasses.is_dataclass(value)
        flat |= flatten(value, f"{prefix}{f.name}.") if nested else {prefix + f.name: value}
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


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
