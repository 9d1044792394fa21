"""The command `python -m granpinn.simulate`: a flow with a known friction law as a flow file.

Exit codes: 0 done; 2 bad input; 1 a solve did not converge; 129, 130, 143 stopped by SIGHUP,
SIGINT, SIGTERM, with the frames so far in the flow file if there are two.

The first word is the scene: `collapse`, which is also the scene without a word, `chute` or
`silo`.

In Python, `granpinn.simulate(mu_s=0.4, mu_2=0.64)` is `granpinn.simulation.simulate`.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("simulate")

import argparse
import dataclasses
import sys
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command.callable_module import call_like
from granpinn.command.parser import Parser, program
from granpinn.config import ConfigError
from granpinn.config.fields import flag_of
from granpinn.config.values import convert
from granpinn.data.flow import Flow
from granpinn.output import make_folder, objection_to_file, objection_to_folder
from granpinn.physics.laws import mu_of_i
from granpinn.simulation import PAPER_CASES, Chute, Collapse, Scene, Silo, simulate
from granpinn.simulation.progress import automatic
from granpinn.simulation.scene import law_settings

EXAMPLES = """examples:
  python -m granpinn.simulate --mu-s 0.4 --mu-2 0.64 --out collapse.h5
      the paper's column, 512 cells across the box
  python -m granpinn.simulate --law coulomb --mu-s 0.4 --out coulomb.h5
      the same column with constant friction
  python -m granpinn.simulate --cells 128 --out quick.h5 --figures figures --animation quick.gif
      a coarse one in a second, with figures and an animation
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
OWN = ("scene", "out", "paper_cases", "figures", "animation")
SCENES: dict[str, type[Scene]] = {"collapse": Collapse, "chute": Chute, "silo": Silo}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""

    def run() -> int:
        _run(parse(sys.argv[1:] if argv is None else argv))
        return 0

    return exit_codes.exit_code("simulate", run)


def parse(argv: Sequence[str]) -> dict[str, Any]:
    """The outputs and settings of a command line, converted to the types of their fields."""
    parser = Parser(
        prog=program("simulate"),
        usage="%(prog)s [collapse|chute|silo] --out FLOW.h5 [settings]",
        description="Simulate a collapse, a chute or a silo of grains with a known friction law.",
        epilog=EXAMPLES.replace("python -m granpinn.simulate", program("simulate")),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
        allow_abbrev=False,
    )
    parser.add_argument(
        "scene",
        nargs="?",
        default="collapse",
        choices=SCENES,
        metavar="SCENE",
        help="collapse: a column that is released (the default); chute: a layer on a slope; "
        "silo: grains that leave through an opening in the floor",
    )
    parser.add_argument("--out", metavar="FLOW.h5", help="the flow file to write")
    parser.add_argument("--paper-cases", metavar="DIR", help="the paper's six regimes, to DIR")
    parser.add_argument("--figures", metavar="DIR", help="profiles and snapshots as PNG, to DIR")
    parser.add_argument("--animation", metavar="FILE.gif", help="the flow as an animated GIF")
    for name, text in _help_of_settings().items():
        parser.add_argument(flag_of(name), dest=name, metavar="VALUE", help=text)
    given = vars(parser.parse_args(argv))
    scene = given.pop("scene")
    kinds = typing.get_type_hints(SCENES[scene])
    for name in given:
        if name not in OWN and name not in kinds:
            other = next(s for s, kind in SCENES.items() if name in typing.get_type_hints(kind))
            raise ConfigError(
                f"{flag_of(name)} is a setting of a {other}, and this is a {scene}: leave it out, "
                f"or begin with the word {other}"
            )
    values = {
        name: Path(value) if name in OWN else convert(value, kinds[name], f"--{name}")
        for name, value in given.items()
    }
    values["scene"] = SCENES[scene]
    _check(values)
    return values


def _help_of_settings() -> dict[str, str]:
    """The help of every setting of any scene; a scene with a setting of its own is named."""
    texts: dict[str, dict[str, str]] = {}
    for scene, kind in SCENES.items():
        for field in dataclasses.fields(kind):
            default = "" if field.default is None else f" (default {field.default})"
            text = (field.metadata["help"] + default).replace("%", "%%")
            texts.setdefault(field.name, {})[scene] = text
    return {
        name: found["collapse"]
        if len(found) == len(SCENES) and len(set(found.values())) == 1
        else "; ".join(f"{scene}: {text}" for scene, text in found.items())
        for name, found in texts.items()
    }


def _check(values: dict[str, Any]) -> None:
    """Raises ConfigError if the outputs are impossible, before anything is computed."""
    if ("out" in values) == ("paper_cases" in values):
        raise ConfigError("give either --out FLOW.h5 or --paper-cases DIR")
    if "paper_cases" in values and {"law", "mu_s", "mu_2", "animation"} & set(values):
        raise ConfigError("--paper-cases has its own law, mu_s and mu_2 and makes no animation")
    if "paper_cases" in values and values["scene"] is not Collapse:
        raise ConfigError("--paper-cases are collapses: leave the word for another scene out")
    if "animation" in values and values["animation"].suffix != ".gif":
        raise ConfigError(f"--animation must end in .gif, got {values['animation']}")
    for name in ("out", "animation"):
        if name not in values:
            continue
        if objection := objection_to_file(values[name]):
            raise ConfigError(f"--{name} {objection}")
    for name in ("figures", "paper_cases"):
        if name in values and (objection := objection_to_folder(values[name])):
            raise ConfigError(f"--{name.replace('_', '-')} {objection}")


def _run(values: dict[str, Any]) -> None:
    outputs = {name: values.pop(name) for name in OWN if name in values}
    if "paper_cases" in outputs:
        _paper_cases(outputs["paper_cases"], Collapse(**values), outputs.get("figures"))
        return
    flow = _one(outputs["scene"](**values), outputs["out"], outputs.get("figures"))
    if "animation" in outputs:
        from granpinn.figures.animation import animate

        print(f"animation: {animate(flow, outputs['animation'])}")


def _one(scene: Scene, out: Path, figures: Path | None) -> Flow:
    """Simulates one scene; its figures are named after the flow file."""
    flow = simulate(scene, out=out, listener=automatic())
    print(f"flow file: {out}")
    if figures is not None:
        from granpinn.figures.simulation import save_figures

        for path in save_figures(flow, figures, out.stem):
            print(f"figure: {path}")
    return flow


def _paper_cases(folder: Path, settings: Collapse, figures: Path | None) -> None:
    """Simulates the paper's six regimes of mu(I) and draws their final states."""
    from granpinn.figures.simulation import save_final_states

    make_folder(folder)
    flows = []
    for mu_s, mu_2 in PAPER_CASES:
        law = law_settings(mu_of_i.LAW, (mu_s, mu_2, settings.I0))
        collapse = dataclasses.replace(settings, **law)
        flows.append(_one(collapse, folder / f"collapse_{mu_s:.2f}_{mu_2:.2f}.h5", figures))
    print(f"figure: {save_final_states(flows, folder / 'final_states.png')}")


call_like(simulate, __name__)

if __name__ == "__main__":
    sys.exit(main())
