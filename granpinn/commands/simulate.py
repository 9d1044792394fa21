"""The command `python -m granpinn.simulate`: a flow with a known friction law as a flow file.

Exit codes: 0 done; 2 bad input; 1 a solve did not converge; 129, 130, 143 stopped by SIGHUP,
SIGINT, SIGTERM, with the frames so far in the flow file if there are two.

The first word is the scene: `collapse`, which is also the scene without a word, or `chute`.

In Python, `granpinn.simulate(mu_s=0.4, mu_2=0.64)` is `granpinn.simulation.simulate`.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.command import cli

    cli.start("simulate")

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command.cli import Command
from granpinn.command.parser import Parser
from granpinn.config import ConfigError, settings_of
from granpinn.config.fields import Setting, flag_of
from granpinn.output import require_file
from granpinn.simulation import Chute, Collapse, Scene, simulate
from granpinn.simulation.run import lines

EXAMPLES = """examples:
  python -m granpinn.simulate --mu-s 0.4 --mu-2 0.64 --out collapse.h5
      the paper's column, 512 cells across the box
  python -m granpinn.simulate --law coulomb --mu-s 0.4 --out coulomb.h5
      the same column with constant friction
  python -m granpinn.simulate --cells 128 --out quick.h5
      a coarse one in a second
  python -m granpinn.simulate --height 0.1 --aspect 2 --gravity 0,-9.81 --density 1550 --d 0.0008 \\
      --length-unit m --time-unit s --out beads.h5
      glass beads in SI units
  python -m granpinn.simulate chute --slope 24 --height 0.04 --g 9.81 --density 1550 --d 0.001 \\
      --length-unit m --time-unit s --out chute.h5
      a layer 40 mm deep that starts from rest on a slope of 24 degrees

Ctrl-C stops and leaves a valid file with the frames so far, if there are two."""
SCENES: dict[str, type[Scene]] = {"collapse": Collapse, "chute": Chute}


def parser() -> Parser:
    made = Parser(
        "simulate",
        "[collapse|chute] --out FLOW.h5 [settings]",
        "Simulate a collapse or a chute of grains with a known friction law.",
        EXAMPLES,
    )
    made.add_argument(
        "scene",
        nargs="?",
        default="collapse",
        choices=tuple(SCENES),
        metavar="SCENE",
        help="collapse: a column that is released (the default); chute: a layer on a slope",
    )
    made.add_argument("--out", type=Path, metavar="FLOW.h5", help="the flow file to write")
    made.add_settings(_settings())
    return made


def _settings() -> dict[str, Setting]:
    """The settings of all scenes; the help names the scenes where they differ."""
    of_scenes: dict[str, dict[str, Setting]] = {}
    for scene, kind in SCENES.items():
        for name, stated in settings_of(kind).items():
            of_scenes.setdefault(name, {})[scene] = stated
    return {
        name: next(iter(found.values()))
        if len(found) == len(SCENES) and len({(s.help, s.default) for s in found.values()}) == 1
        else dataclasses.replace(
            next(iter(found.values())),
            default=None,
            help="; ".join(
                f"{scene}: {s.help}" + ("" if s.default is None else f" (default {s.default})")
                for scene, s in found.items()
            ),
        )
        for name, found in of_scenes.items()
    }


def parse(argv: Sequence[str]) -> tuple[type[Scene], Path, dict[str, Any]]:
    """The class of the scene, the flow file, and the settings of a command line."""
    given = vars(parser().parse_args(argv))
    name = given.pop("scene")
    out: Path | None = given.pop("out", None)
    for key in given:
        if key not in settings_of(SCENES[name]):
            other = next(scene for scene, kind in SCENES.items() if key in settings_of(kind))
            raise ConfigError(
                f"{flag_of(key)} is a setting of a {other}, and this is a {name}: leave it out, "
                f"or begin with the word {other}"
            )
    if out is None:
        raise ConfigError("--out, the flow file to write, is missing: give --out FLOW.h5")
    return SCENES[name], require_file(out), given


def run(argv: Sequence[str]) -> int:
    kind, out, settings = parse(argv)
    scene = kind(**settings)
    t_end = scene.resolved().t_end
    assert t_end is not None
    simulate(scene, out=out, listener=lines(t_end))
    print(f"flow file: {out}")
    return 0


main = Command("simulate", parser, run)
