"""The command line of `granpinn train`, made from the fields of Config.

Later ones win: recipe, `config.toml` of the run that is resumed, `--config` file, flags. The word
`none` stands for no value.
"""

from __future__ import annotations

import argparse
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from granpinn.command.parser import Parser, program
from granpinn.config import Config, ConfigError, settings_of
from granpinn.config.fields import Setting, flag_of, sections_of, without_none
from granpinn.config.toml import read_saved, read_toml
from granpinn.config.values import NONE, convert
from granpinn.physics.laws import LAWS

# Without a flow file: the collapse that comes with the package, in fewer steps than by default.
DEMONSTRATION = {"out": "granpinn-demo", "steps": 6000}
# The settings in --help, which has --config and --help-all too; --help-all has the others.
USUAL = (
    *("out", "level", "law", "recipe", "I0", "seed", "members", "device", "max_time", "steps"),
    *("checks", "compare_laws", "resimulate", "resume"),
)
EXAMPLES = """examples:
  python -m granpinn.train
      a demonstration: the collapse that comes with granpinn, to the folder granpinn-demo; it
      takes every setting, such as --max-time 60
  python -m granpinn.train collapse.h5 --out run
      identify the friction law from velocities and the line of the free surface (level V1)
  python -m granpinn.train collapse.h5 --out run --members 8
      the same with eight networks, for a steadier value; on a GPU nearly as fast as one
  python -m granpinn.train collapse.h5 --out run --max-time 600
      the same, planned to end within 10 minutes
  python -m granpinn.train heap.h5 chute.h5 --one-law --out run
      one friction law from several flows of one material
  python -m granpinn.train --out run --resume
      continue an interrupted run
  python -m granpinn.train collapse.h5 --out paper --recipe paper --steps 30000
      the paper's method, with fewer steps

Ctrl-C saves a checkpoint and stops; a second Ctrl-C stops at once."""


class Arguments(NamedTuple):
    """What a command line gives: settings, and whether to print all that is known."""

    config: Config
    verbose: bool


def parse(argv: Sequence[str]) -> Arguments:
    """The arguments of a command line; the message of ConfigError is one sentence.

    Without a flow file: the settings of the demonstration, changed by those that are given.
    """
    argv = switches(argv)
    parser = Parser(
        prog=program("train"),
        usage="%(prog)s [FLOW.h5 ... --out DIR] [settings]",
        description="Identify the friction law and the pressure of a granular flow.",
        epilog=EXAMPLES.replace("python -m granpinn.train", program("train")),
        formatter_class=_Help,
        argument_default=argparse.SUPPRESS,
        allow_abbrev=False,
    )
    parser.add_argument("flow", nargs="*", metavar="FLOW", help="the flow file (HDF5)")
    parser.add_argument(
        "--one-law",
        action="store_true",
        default=False,
        help="identify one friction law from several flow files of one material",
    )
    parser.add_argument("--config", metavar="FILE.toml", help="settings from a file; flags win")
    parser.add_argument("--help-all", action="help", help="show every setting")
    parser.add_argument(
        "--verbose",
        action="store_true",
        default=False,
        help="print tables, errors of the fields and every check too, as soon as they are known",
    )
    _add_settings(parser, everything="--help-all" in argv)
    given = vars(parser.parse_args(argv))
    file, verbose = given.pop("config", None), given.pop("verbose")
    flows, one_law = given.pop("flow", []), given.pop("one_law")
    if len(flows) > 1 and not one_law:
        raise ConfigError(
            f"expected one flow file, got {len(flows)}: --one-law identifies one friction law from "
            "several flows of one material; else train each by itself"
        )
    known = settings_of(Config)
    flags = {key: convert(text, known[key].kind, flag_of(key)) for key, text in given.items()}
    if flows:
        flags |= {"flow": flows[0], "further_flows": tuple(flows[1:])}
    values = read_toml(Path(file)) if file else {}
    if flags.get("recipe", values.get("recipe")) != values.get("recipe", flags.get("recipe")):
        raise ConfigError(
            f"--recipe {flags['recipe']} contradicts {file}, which has the recipe "
            f"{values['recipe']}: leave one of them out"
        )
    if "flow" not in (flags | values):
        values.setdefault("out", DEMONSTRATION["out"])
    saved = Path(flags.get("out") or values.get("out") or "") / "config.toml"
    if flags.get("resume", values.get("resume")) and saved.exists():
        values = read_saved(saved) | values
    values |= flags
    if values.get("flow") is None and not values.get("resume"):
        values = _demonstration(values)
    config = Config(**values)
    if "I0" in flags and "I0" not in LAWS[config.law].names:
        raise ConfigError(f"the friction law {config.law} has no I0: leave --I0 out")
    for name, text in (("flow", "FLOW, the flow file,"), ("out", "--out, the folder of the run,")):
        if getattr(config, name) is None:
            raise ConfigError(f"{text} is missing: {program('train')} FLOW.h5 --out DIR")
    return Arguments(config, verbose)


def _demonstration(values: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of the demonstration, changed by those that are given."""
    from granpinn.simulation import demo_path

    ends = {name for name in ("steps", "epochs", "max_time") if name in values}
    usual = {name: v for name, v in DEMONSTRATION.items() if name != "steps" or not ends}
    return usual | dict(values) | {"flow": str(demo_path())}


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help with one line for the name and the rest for the explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=30, width=100)


def switches(argv: Sequence[str]) -> list[str]:
    """The arguments with a value for every switch: --x, --x true, --no-x become --x=true or false.

    So a switch never takes the word after it, unless that is true or false.
    """
    flags = {flag_of(key) for key, stated in settings_of(Config).items() if stated.kind is bool}
    off = {f"--no-{flag.removeprefix('--')}": flag for flag in flags}
    made: list[str] = []
    words = list(argv)
    while words:
        word = words.pop(0)
        if word in flags:
            value = words.pop(0) if words and words[0].lower() in ("true", "false") else "true"
            word = f"{word}={value.lower()}"
        made.append(f"{off[word]}=false" if word in off else word)
    return made


def _add_settings(parser: argparse.ArgumentParser, everything: bool) -> None:
    """One argument per setting, grouped as the sections are; the help has `USUAL` or all."""
    groups: dict[str, Any] = {"": parser}
    for name, kind in sections_of(Config).items():
        groups[name] = parser.add_argument_group(name, kind.__doc__) if everything else parser
    for key, stated in settings_of(Config).items():
        if key in ("flow", "further_flows"):
            continue
        group, flag = groups[key.rpartition(".")[0]], flag_of(key)
        text = stated.help.replace("%", "%%")
        shown = everything or key in USUAL
        if stated.kind is bool:
            off = f" (on; off: --no-{flag.removeprefix('--')})" if stated.default else ""
            help = text + off if shown else argparse.SUPPRESS
            group.add_argument(flag, dest=key, nargs="?", metavar="true|false", help=help)
        else:
            text += f" (default {_shown(stated.default)})"
            help = text if shown else argparse.SUPPRESS
            group.add_argument(flag, dest=key, metavar=metavar_of(stated), help=help)


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
