"""The command `python -m granpinn.simulate`: a flow with a known friction law as a flow file.

Exit codes: 0 done; 2 bad input; 1 a solve did not converge; 129, 130, 143 stopped by SIGHUP,
SIGINT, SIGTERM, with the frames so far in the flow file if there are two.

The first word is the scene: `collapse`, which is also the scene without a word, or `chute`.

In Python, `granpinn.simulate(mu_s=0.4, mu_2=0.64)` is `granpinn.simulation.simulate`.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("simulate")

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.parser import Parser
from granpinn.config import settings_of
from granpinn.output import require_file
from granpinn.progress import automatic
from granpinn.simulation import Chute, Collapse, Scene, simulate

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


def parser(scene: str = "collapse") -> Parser:
    other = next(name for name in SCENES if name != scene)
    made = Parser(
        "simulate",
        "[collapse|chute] --out FLOW.h5 [settings]",
        f"Simulate grains with a known friction law. These are the settings of a {scene}; "
        f"granpinn simulate {other} --help shows those of a {other}.",
        EXAMPLES,
    )
    made.add_argument(
        "--out", type=Path, metavar="FLOW.h5", required=True, help="the flow file to write"
    )
    made.add_settings(settings_of(SCENES[scene]))
    return made


def run(argv: Sequence[str]) -> int:
    named = bool(argv) and argv[0] in SCENES
    name = argv[0] if named else "collapse"
    given = vars(parser(name).parse_args(argv[1:] if named else argv))
    out = require_file(given.pop("out"))
    simulate(SCENES[name](**given), out=out, progress=automatic())
    print(f"flow file: {out}")
    return 0


main = partial(exit_code, "simulate", run)
