"""The command `python -m granpinn.train FLOW.h5 --out DIR`: from a flow file to a report.

flow file -> noise -> training set -> identification -> results.json, fields.h5 -> checks -> report

Whatever follows the first results.json fails alone: it becomes a sentence in `not_done` of
results.json, in the terminal and on the page.

The work is in commands/shared/training_run.py, which is loaded after the words of the command: so
`--help` and refusals are quick.

Exit codes: 0 done, also without a check of the default, a figure or the page; 2 bad input; 1 the
run could not go on, or it lacks fields or a check that a setting asks for; 129, 130, 143 stopped by
SIGHUP, SIGINT, SIGTERM.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("train")

import time
from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from granpinn.commands.shared.exit_codes import exit_code, keep_what_is_loaded
from granpinn.commands.shared.parser import Parser, program
from granpinn.config import Config, ConfigError, settings_of
from granpinn.config.fields import sections_of
from granpinn.config.toml import read_toml
from granpinn.physics.laws import LAWS

# Without a flow file: the collapse that comes with the package, in fewer steps than by default.
DEMONSTRATION = {"out": "granpinn-demo", "steps": 6000}
# The settings in --help, which has --config and --help-all too; --help-all has the others.
USUAL = (
    *("out", "level", "law", "recipe", "I0", "seed", "members", "device", "max_time", "steps"),
    *("checks", "compare_laws", "resume"),
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


def parser(usual: Collection[str] | None = None) -> Parser:
    """The parser; `usual`: the settings that its help shows, by default all."""
    made = Parser(
        "train",
        "[FLOW.h5 ... --out DIR] [settings]",
        "Identify the friction law and the pressure of a granular flow.",
        EXAMPLES,
    )
    made.add_argument("flow", nargs="*", metavar="FLOW", help="the flow file (HDF5)")
    made.add_argument(
        "--one-law",
        action="store_true",
        default=False,
        help="identify one friction law from several flow files of one material",
    )
    made.add_argument("--config", metavar="FILE.toml", help="settings from a file; flags win")
    made.add_argument(
        "--verbose",
        action="store_true",
        default=False,
        help="print tables, errors of the fields and every check too",
    )
    made.add_argument("--help-all", action="help", help="show every setting")
    groups = {name: kind.__doc__ or "" for name, kind in sections_of(Config).items()}
    positional = ("flow", "further_flows")
    flags = {key: stated for key, stated in settings_of(Config).items() if key not in positional}
    made.add_settings(flags, groups, usual)
    return made


def parse(argv: Sequence[str]) -> tuple[Config, bool]:
    """The settings, and whether to print all; the message of ConfigError is one sentence.

    Later ones win: recipe, `config.toml` of the run that is resumed, `--config` file, flags.
    Without a flow file: the settings of the demonstration, changed by those that are given.
    """
    usual = None if "--help-all" in argv else USUAL
    flags = vars(parser(usual).parse_args(argv))
    file, verbose = flags.pop("config", None), flags.pop("verbose")
    flows, one_law = flags.pop("flow", []), flags.pop("one_law")
    if len(flows) > 1 and not one_law:
        raise ConfigError(
            f"expected one flow file, got {len(flows)}: --one-law identifies one friction law from "
            "several flows of one material; else train each by itself"
        )
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
        values = read_toml(saved) | values
    values |= flags
    if values.get("flow") is None and not values.get("resume"):
        values = _demonstration(values)
    config = Config(**values)
    if "I0" in flags and "I0" not in LAWS[config.law].names:
        raise ConfigError(f"the friction law {config.law} has no I0: leave --I0 out")
    for name, text in (("flow", "FLOW, the flow file,"), ("out", "--out, the folder of the run,")):
        if getattr(config, name) is None:
            raise ConfigError(f"{text} is missing: {program('train')} FLOW.h5 --out DIR")
    return config, verbose


def _demonstration(values: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of the demonstration, changed by those that are given."""
    from granpinn.simulation import demo_path

    ends = {name for name in ("steps", "epochs", "max_time") if name in values}
    usual = {name: v for name, v in DEMONSTRATION.items() if name != "steps" or not ends}
    return usual | dict(values) | {"flow": str(demo_path())}


def run(argv: Sequence[str]) -> int:
    begin = time.monotonic()
    config, verbose = parse(argv)
    from granpinn import foreign

    foreign.start()  # it opens the flow file; its imports run beside those of torch
    from granpinn.commands.shared import training_run

    keep_what_is_loaded()
    return training_run.run(config, verbose, begin)


main = partial(exit_code, "train", run)
