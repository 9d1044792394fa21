"""What the studies share: settings from the command line, raw results as JSON."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.machine import describe
from granpinn.config import Config, ConfigError, fields
from granpinn.results.decoding import plain


def parse(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None
) -> tuple[argparse.Namespace, list[str], Config]:
    """Options of a study, the other words of the command line, and the settings that these are."""
    options, words = parser.parse_known_args(arguments)
    try:
        return options, words, config_of(words)
    except ConfigError as error:
        parser.error(str(error))


def config_of(words: Sequence[str], settings: Mapping[str, Any] | None = None) -> Config:
    """The settings of an identification: `settings`, and words of a command line over them.

    Raises:
        ConfigError: a word is not a setting of granpinn.train, or a value is out of range.
    """
    return Config(**{**(settings or {}), **settings_of(words)})


def settings_of(words: Sequence[str]) -> dict[str, Any]:
    """`--steps 200 --network.widths 64,64` as settings of the identification."""
    stated = fields.settings_of(Config)
    known = {fields.flag_of(key): key for key in stated}
    values = {}
    padded = [*words, ""][: len(words) + len(words) % 2]
    for flag, text in zip(padded[::2], padded[1::2], strict=True):
        if flag not in known or not text:
            raise ConfigError(f"{flag} must be a setting of granpinn.train and have a value")
        values[known[flag]] = stated[known[flag]].of_text(text, flag)
    return values


def write(path: Path | None, found: dict[str, Any]) -> dict[str, Any]:
    """Raw results with the date and the machine, written where a file is asked for.

    NaN becomes null, since JSON has no NaN.
    """
    head = {"date": time.strftime("%Y-%m-%d"), "machine": describe()}
    whole: dict[str, Any] = plain(head | found)
    if path is not None:
        path.write_text(json.dumps(whole, indent=1, allow_nan=False) + "\n")
    return whole
