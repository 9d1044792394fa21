"""Settings as TOML files, in which the word "none" stands for no value."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from granpinn.config.fields import NONE, ConfigError, flatten, settings_of, unknown
from granpinn.config.settings import Config
from granpinn.regular import read_text

MAX_BYTES = 2**20


def read_toml(path: Path) -> dict[str, Any]:
    """Dotted settings of a TOML file."""
    try:
        content = tomllib.loads(read_text(path, MAX_BYTES))
    except FileNotFoundError:
        raise ConfigError(f"{path} does not exist: --config expects a TOML file") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} could not be read as TOML: {error}") from None
    known, values = settings_of(Config), flatten(content)
    for key, value in values.items():
        if key not in known:
            raise ConfigError(f"{path}, perhaps of another version, has the {unknown(key, known)}")
        values[key] = known[key].check(value, f"{path}: {key}")
    return values


def to_toml(config: Config) -> str:
    """The TOML text that `Config(**read_toml(path))` takes again."""
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
