"""The command line of `granpinn train`, made from the fields of Config.

Later ones win: recipe, `config.toml` of the run that is resumed, `--config` file, flags. The word
`none` stands for no value.
"""

from __future__ import annotations

import argparse
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command.parser import Parser
from granpinn.config import Config, ConfigError, settings_of
from granpinn.config.fields import Setting, flag_of, sections_of, without_none
from granpinn.config.toml import read_saved, read_toml
from granpinn.config.values import NONE, convert
from granpinn.physics.laws import LAWS
from granpinn.simulation import demo_path

# `python -m granpinn.train` without arguments: the collapse that comes with the package, in half
# the steps of the default recipe.
DEMONSTRATION = ("--out", "granpinn-demo", "--steps", "20000")
EXAMPLES = """examples:
  python -m granpinn.train
      a demonstration: the collapse that comes with granpinn, to the folder granpinn-demo
  python -m granpinn.train collapse.h5 --out run
      identify the friction law from velocities and the line of the free surface (level V1)
  python -m granpinn.train collapse.h5 --out run --members 8
      the same with eight networks, for a steadier value; on a GPU nearly as fast as one
  python -m granpinn.train collapse.h5 --out run --max-time 600
      the same, planned to end within 10 minutes
  python -m granpinn.train --out run --resume
      continue an interrupted run
  python -m granpinn.train collapse.h5 --out paper --recipe paper --steps 30000
      the paper's method, with fewer steps

Ctrl-C saves a checkpoint and stops; a second Ctrl-C stops at once."""


def parse(argv: Sequence[str]) -> Config:
    """The settings of a command line; the message of ConfigError is one sentence.

    Without arguments: the settings of the demonstration.
    """
    argv = argv or [str(demo_path()), *DEMONSTRATION]
    parser = Parser(
        prog="python -m granpinn.train",
        usage="%(prog)s FLOW.h5 --out DIR [settings]",
        description="Identify the friction law and the pressure of a granular flow.",
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
    known = settings_of(Config)
    flags = {key: convert(text, known[key].kind, flag_of(key)) for key, text in given.items()}
    values = read_toml(Path(file)) if file else {}
    if flags.get("recipe", values.get("recipe")) != values.get("recipe", flags.get("recipe")):
        raise ConfigError(
            f"--recipe {flags['recipe']} contradicts {file}, which has the recipe "
            f"{values['recipe']}: leave one of them out"
        )
    saved = Path(flags.get("out") or values.get("out") or "") / "config.toml"
    if flags.get("resume", values.get("resume")) and saved.exists():
        values = read_saved(saved) | values
    config = Config(**(values | flags))
    if "I0" in flags and "I0" not in LAWS[config.law].names:
        raise ConfigError(f"the friction law {config.law} has no I0: leave --I0 out")
    for name, text in (("flow", "FLOW, the flow file,"), ("out", "--out, the folder of the run,")):
        if getattr(config, name) is None:
            raise ConfigError(f"{text} is missing: python -m granpinn.train FLOW.h5 --out DIR")
    return config


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help with one line for the name and the rest for the explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=30, width=100)


def _add_settings(parser: argparse.ArgumentParser) -> None:
    """One argument per setting, grouped as the sections are."""
    groups: dict[str, Any] = {"": parser}
    for name, kind in sections_of(Config).items():
        groups[name] = parser.add_argument_group(name, kind.__doc__)
    for key, stated in settings_of(Config).items():
        if key == "flow":
            continue
        group, flag = groups[key.rpartition(".")[0]], flag_of(key)
        text = stated.help.replace("%", "%%")
        if stated.kind is bool:
            group.add_argument(flag, dest=key, action="store_true", help=text)
        else:
            text += f" (default {_shown(stated.default)})"
            group.add_argument(flag, dest=key, metavar=metavar_of(stated), help=text)


def metavar_of(stated: Setting) -> str:
    """The placeholder for the value of a setting in the help, such as {V0,V1,V2} or N."""
    if stated.choices:
        return "{" + ",".join(stated.choices) + "}"
    kind, _ = without_none(stated.kind)
    names = {int: "N", float: "X", str: "PATH"}
    if typing.get_origin(kind) is not tuple:
        return names[kind]
    item = names[typing.get_args(kind)[0]]
    return f"{item},{item},..."


def _shown(value: Any) -> str:
    if value is None:
        return NONE
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
