"""Settings as text: the command line and TOML files, both made from the fields of Config.

Layers, later ones win: recipe, `config.toml` of the run that is resumed, `--config` file, flags.
The word `none` stands for "no value", in TOML too, which has no word of its own for it.
"""

from __future__ import annotations

import argparse
import dataclasses
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command.parser import Parser
from granpinn.config import Config, ConfigError, flatten, kinds_of
from granpinn.config.recipes import build
from granpinn.config.toml import NONE, convert, read_toml
from granpinn.simulation import demo_path

# What a bare `python -m granpinn.train` runs: the collapse that comes with the package, in half the
# steps of the default recipe.
DEMONSTRATION = ("--out", "granpinn-demo", "--steps", "20000")
EXAMPLES = """examples:
  python -m granpinn.train
      try it: the collapse that comes with granpinn, in a few minutes, to the folder granpinn-demo
  python -m granpinn.train collapse.h5 --out run
      identify mu_s and mu_2 from velocities and the line of the free surface (level V1)
  python -m granpinn.train collapse.h5 --out run --members 8
      the same with eight networks, for a steadier value; on a GPU little slower than one
  python -m granpinn.train collapse.h5 --out run --max-time 600
      the same, planned to end within 10 minutes
  python -m granpinn.train --out run --resume
      continue an interrupted run
  python -m granpinn.train collapse.h5 --out paper --recipe paper --steps 30000
      the paper's method, with fewer steps

Ctrl-C saves a checkpoint and stops; a second Ctrl-C stops at once."""


def parse(argv: Sequence[str]) -> Config:
    """The settings of a command line; ConfigError says in one sentence what is wrong with it.

    Without any argument: the demonstration.
    """
    argv = argv or [str(demo_path()), *DEMONSTRATION]
    parser = Parser(
        prog="python -m granpinn.train",
        usage="%(prog)s FLOW.h5 --out DIR [settings]",
        description="Identify the friction law mu(I) and the pressure of a granular flow.",
        epilog=EXAMPLES,
        formatter_class=_Help,
        argument_default=argparse.SUPPRESS,
        allow_abbrev=False,
    )
    parser.add_argument("flow", nargs="?", metavar="FLOW", help="the flow file (HDF5)")
    parser.add_argument("--config", metavar="FILE.toml", help="settings from a file; flags win")
    _add_settings(parser)
    given = vars(parser.parse_args(argv))
    file = given.pop("config", None)
    kinds = kinds_of(Config)
    flags = {k: convert(v, kinds[k], f"--{flag_of(k)}") for k, v in given.items()}
    values = read_toml(Path(file)) if file else {}
    if flags.get("recipe", values.get("recipe")) != values.get("recipe", flags.get("recipe")):
        raise ConfigError(
            f"--recipe {flags['recipe']} contradicts {file}, which is for the recipe "
            f"{values['recipe']}: leave one of them out"
        )
    saved = Path(flags.get("out") or values.get("out") or "") / "config.toml"
    if flags.get("resume", values.get("resume")) and saved.exists():
        values = read_toml(saved) | values
    config = build(values | flags)
    for name, text in (("flow", "FLOW, the flow file,"), ("out", "--out, the folder of the run,")):
        if getattr(config, name) is None:
            raise ConfigError(f"{text} is missing: python -m granpinn.train FLOW.h5 --out DIR")
    return config


def flag_of(key: str) -> str:
    """The flag of a setting: `max_time` is --max-time; names inside a section stay as they are."""
    return key if "." in key else key.replace("_", "-")


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help with one line for the name and the rest for the explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=30, width=100)


def _add_settings(parser: argparse.ArgumentParser) -> None:
    """One argument per field of Config, grouped as the sections are."""
    defaults = flatten(build({}))
    kinds = kinds_of(Config)
    groups: dict[str, Any] = {"": parser}
    for f in dataclasses.fields(Config):
        if dataclasses.is_dataclass(kinds_section := typing.get_type_hints(Config)[f.name]):
            doc = (kinds_section.__doc__ or "").strip()
            groups[f.name] = parser.add_argument_group(f"{f.name}", doc)
    for key, kind in kinds.items():
        if key == "flow":
            continue
        section, _, name = key.rpartition(".")
        text = _help_of(section, name).replace("%", "%%")
        flag = f"--{flag_of(key)}"
        if kind is bool:
            groups[section].add_argument(flag, dest=key, action="store_true", help=text)
        else:
            text = f"{text} (default {_shown(defaults[key])})"
            metavar = _metavar(kind)
            groups[section].add_argument(flag, dest=key, metavar=metavar, help=text)


def _help_of(section: str, name: str) -> str:
    cls: Any = typing.get_type_hints(Config)[section] if section else Config
    found = {f.name: f.metadata["help"] for f in dataclasses.fields(cls) if "help" in f.metadata}
    return str(found[name])


def _metavar(kind: Any) -> str:
    if isinstance(kind, types.UnionType):
        return _metavar(typing.get_args(kind)[0])
    if typing.get_origin(kind) is typing.Literal:
        return "{" + ",".join(typing.get_args(kind)) + "}"
    names = {int: "N", float: "X", str: "PATH"}
    return names.get(kind, "N,N,...")


def _shown(value: Any) -> str:
    if value is None:
        return NONE
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
