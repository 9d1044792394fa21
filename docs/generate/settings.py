"""The reference of settings: their defaults, their help and the recipes, from granpinn.config."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from granpinn.config import RECIPES, Config, flatten
from granpinn.config.fields import as_text


def reference() -> str:
    """The tables of all settings."""
    return "\n".join(settings())


def recipe_table() -> str:
    """The table of the recipes."""
    return "\n".join(recipes())


def settings() -> Iterator[str]:
    """A table for the settings without a section, then one for each section."""
    config = Config()
    sections = [f for f in dataclasses.fields(config) if is_section(config, f)]
    yield from table([f for f in dataclasses.fields(config) if f not in sections])
    for section in sections:
        group = getattr(config, section.name)
        yield from ("", f"### [{section.name}]", "", group.__doc__.strip(), "")
        yield from table(dataclasses.fields(group))


def is_section(config: Config, field: dataclasses.Field[Any]) -> bool:
    """Whether a field of the settings is a group of settings."""
    return dataclasses.is_dataclass(getattr(config, field.name))


def table(fields: Any) -> Iterator[str]:
    """Name, default and help of settings."""
    yield from ("| setting | default | meaning |", "|---|---|---|")
    for f in fields:
        yield f"| `{f.name}` | {value(f.default)} | {f.metadata['help']} |"


def recipes() -> Iterator[str]:
    """The settings that a recipe changes, one column for each recipe."""
    default = flatten(Config())
    changed = [key for key in default if any(key in recipe for recipe in RECIPES.values())]
    yield f"| setting | {' | '.join(RECIPES)} |"
    yield "|---|" + "---|" * len(RECIPES)
    for key in changed:
        cells = (value(recipe.get(key, default[key])) for recipe in RECIPES.values())
        yield f"| `{key}` | {' | '.join(cells)} |"


def value(given: Any) -> str:
    """A value as on the command line."""
    return "none" if given is None else f"`{as_text(given)}`"
