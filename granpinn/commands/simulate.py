"""The command `python -m granpinn.simulate`: a flow with a known friction law as a flow file.

Exit codes: 0 done; 2 bad input; 1 a solve did not converge; 129, 130, 143 stopped by SIGHUP,
SIGINT, SIGTERM, with the frames so far in the flow file if there are two.

The first word is the scene: `collapse`, which is also the scene without a word, `chute` or
`silo`.

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
from granpinn.data.flow import Flow
from granpinn.output import make_folder, objection_to_file, objection_to_folder
from granpinn.physics.laws import mu_of_i
from granpinn.simulation import PAPER_CASES, Chute, Collapse, Scene, Silo, simulate
from granpinn.simulation.run import lines
from granpinn.simulation.scene import law_settings

EXAMPLES = """examples:
  python -m granpinn.simulate --mu-s 0.4 --mu-2 0.64 --out collapse.h5
      the paper's column, 512 cells across the box
  python -m granpinn.simulate --law coulomb --mu-s 0.4 --out coulomb.h5
      the same column with constant friction
  python -m granpinn.simulate --cells 128 --out quick.h5 --animation quick.gif
      a coarse one in a second, with an animation
  python -m granpinn.simulate --paper-cases cases
      the six regimes of the paper and its figure 3
  python -m granpinn.simulate --height 0.1 --aspect 2 --gravity 0,-9.81 --density 1550 --d 0.0008 \\
      --length-unit m --time-unit s --out beads.h5
      glass beads in SI units
  python -m granpinn.simulate chute --slope 24 --height 0.04 --g 9.81 --density 1550 --d 0.001 \\
      --length-unit m --time-unit s --out chute.h5
      a layer 40 mm deep that starts from rest on a slope of 24 degrees
  python -m granpinn.simulate silo --width 40 --height 60 --outlet 12 --d 1 --out silo.h5
      a silo that empties through an opening 12 grains wide

Ctrl-C stops and leaves a valid file with the frames so far, if there are two."""
OUTPUTS = ("out", "paper_cases", "animation")
SCENES: dict[str, type[Scene]] = {"collapse": Collapse, "chute": Chute, "silo": Silo}


def parser() -> Parser:
    made = Parser(
        "simulate",
        "[collapse|chute|silo] --out FLOW.h5 [settings]",
        "Simulate a collapse, a chute or a silo of grains with a known friction law.",
        EXAMPLES,
    )
    made.add_argument(
        "scene",
        nargs="?",
        default="collapse",
        choices=tuple(SCENES),
        metavar="SCENE",
        help="collapse: a column that is released (the default); chute: a layer on a slope; "
        "silo: grains that leave through an opening in the floor",
    )
    for flag, metavar, text in (
        ("--out", "FLOW.h5", "the flow file to write"),
        ("--paper-cases", "DIR", "the paper's six regimes, to DIR"),
        ("--animation", "FILE.gif", "the flow as an animated GIF"),
    ):
        made.add_argument(flag, type=Path, metavar=metavar, help=text)
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


def parse(argv: Sequence[str]) -> tuple[type[Scene], dict[str, Path], dict[str, Any]]:
    """The class of the scene, the outputs, and the settings of a command line."""
    given = vars(parser().parse_args(argv))
    name = given.pop("scene")
    outputs = {key: given.pop(key) for key in OUTPUTS if key in given}
    for key in given:
        if key not in settings_of(SCENES[name]):
            other = next(scene for scene, kind in SCENES.items() if key in settings_of(kind))
            raise ConfigError(
                f"{flag_of(key)} is a setting of a {other}, and this is a {name}: leave it out, "
                f"or begin with the word {other}"
            )
    _check(SCENES[name], outputs, given)
    return SCENES[name], outputs, given


def _check(scene: type[Scene], outputs: dict[str, Path], settings: dict[str, Any]) -> None:
    """Raises ConfigError if the outputs are impossible, before anything is computed."""
    if ("out" in outputs) == ("paper_cases" in outputs):
        raise ConfigError("give either --out FLOW.h5 or --paper-cases DIR")
    if "paper_cases" in outputs and {"law", "mu_s", "mu_2", "animation"} & {*settings, *outputs}:
        raise ConfigError("--paper-cases has its own law, mu_s and mu_2 and makes no animation")
    if "paper_cases" in outputs and scene is not Collapse:
        raise ConfigError("--paper-cases are collapses: leave the word for another scene out")
    if "animation" in outputs and outputs["animation"].suffix != ".gif":
        raise ConfigError(f"--animation must end in .gif, got {outputs['animation']}")
    for name, path in outputs.items():
        file = name in ("out", "animation")
        if objection := objection_to_file(path) if file else objection_to_folder(path):
            raise ConfigError(f"{flag_of(name)} {objection}")


def run(argv: Sequence[str]) -> int:
    scene, outputs, settings = parse(argv)
    if "paper_cases" in outputs:
        _paper_cases(outputs["paper_cases"], Collapse(**settings))
        return 0
    flow = _one(scene(**settings), outputs["out"])
    if "animation" in outputs:
        from granpinn.figures.animation import animate

        print(f"animation: {animate(flow, outputs['animation'])}")
    return 0


def _one(scene: Scene, out: Path) -> Flow:
    """Simulates one scene."""
    t_end = scene.resolved().t_end
    assert t_end is not None
    flow = simulate(scene, out=out, listener=lines(t_end))
    print(f"flow file: {out}")
    return flow


def _paper_cases(folder: Path, settings: Collapse) -> None:
    """Simulates the paper's six regimes of mu(I) and draws their final states."""
    from granpinn.figures.simulation import save_final_states

    make_folder(folder)
    flows = []
    for mu_s, mu_2 in PAPER_CASES:
        law = law_settings(mu_of_i.LAW, (mu_s, mu_2, settings.I0))
        collapse = dataclasses.replace(settings, **law)
        flows.append(_one(collapse, folder / f"collapse_{mu_s:.2f}_{mu_2:.2f}.h5"))
    print(f"figure: {save_final_states(flows, folder / 'final_states.png')}")


main = Command("simulate", parser, run)
