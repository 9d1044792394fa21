"""The command `python -m granpinn.inspect`: quality of data and precision of the law from it.

Exit codes: 0 done; 2 bad input; 1 the results cannot be written.

In Python, `granpinn.inspect(flow)` gives the same numbers.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("inspect")

import dataclasses
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.flow_files import require_flow_files, training_of
from granpinn.commands.shared.parser import Parser, program
from granpinn.config import ConfigError, SideWalls, settings_of
from granpinn.data import read_flow
from granpinn.data.symmetry import said
from granpinn.inspection import AssumedLaw, inspect
from granpinn.output import make_folder, write_text
from granpinn.terminal import shell_word
from granpinn.uncertainty import expected

EXAMPLES = """examples:
  python -m granpinn.inspect flow.h5
      numbers, and what they tell of a law
  python -m granpinn.inspect flow.h5 --out inspection
      and inspect.json with maps of the gaps, the speed, the noise and the inertial numbers
  python -m granpinn.inspect flow.h5 --I0 0.28 --mu-s 0.3 --mu-2 0.6
      the precision for a material that is roughly known
  python -m granpinn.inspect heap.h5 chute.h5
      how well flows of one material fix one law, and which flow to film next
  python -m granpinn.inspect flow.h5 --law coulomb
      the precision of constant friction"""
WALLS = {name: f"side_walls.{name}" for name in settings_of(SideWalls)}  # as in a run


def parser() -> Parser:
    made = Parser(
        "inspect",
        "FLOW.h5 [FLOW.h5 ...] [--out DIR] [--json]",
        "Inspect velocity data and estimate how precisely they fix the friction law.",
        EXAMPLES,
    )
    made.add_argument("data", metavar="FLOW.h5", type=Path, nargs="+", help="a flow file")
    made.add_argument(
        "--out", metavar="DIR", type=Path, default=None, help="folder for figures and numbers"
    )
    made.add_argument(
        "--json", action="store_true", default=False, help="print all numbers as JSON"
    )
    made.add_settings(
        {
            name: dataclasses.replace(s, help=f"{s.help}; assumed for the expected precision")
            for name, s in settings_of(AssumedLaw).items()
        }
    )
    made.add_settings({WALLS[name]: stated for name, stated in settings_of(SideWalls).items()})
    return made


def run(argv: Sequence[str]) -> int:
    given = vars(parser().parse_args(argv))
    paths, out, as_json = (given.pop(name) for name in ("data", "out", "json"))
    walls = {name: given.pop(flag) for name, flag in WALLS.items() if flag in given}
    try:
        law = AssumedLaw(**given)
    except ValueError as error:
        raise ConfigError(f"the friction law is impossible: {error}") from None
    require_flow_files(paths, "inspect")
    if len(paths) > 1 and (as_json or out is not None):
        raise ConfigError(
            f"expected one flow file with --json or --out, got {len(paths)}: inspect one at a time"
        )
    if len(paths) > 1:
        print("\n".join(expected.lines([read_flow(path) for path in paths])))
        print(f"next: {program('train')} {' '.join(map(shell_word, paths))} --one-law --out run")
        return 0
    flow = read_flow(paths[0])
    found = inspect(flow, law, SideWalls(**walls))
    numbers = json.dumps(found.numbers(), indent=2, allow_nan=False)
    if out is not None:
        from granpinn.figures.style import save  # matplotlib is slow to import

        write_text(make_folder(out) / "inspect.json", numbers + "\n")
        for record in found.records.values():
            for name, (_, draw) in record.figures().items():
                save(draw(found).figure, out / f"{name}.png")
    if as_json:
        print(numbers)
        return 0
    if (mean := said(found.flow)) is not None:
        print(mean)
    elif found.flow.t.size < flow.t.size:
        print(
            f"large flow: measured in {found.flow.t.size} of {flow.t.size} frames, checked in all"
        )
    print("\n".join(found.lines()))
    if out is not None:
        print(f"figures and inspect.json: {out}")
    if found.slips:
        print("next: mend the flow file, or convert again with the right calibration")
    else:
        print(f"next: {training_of(flow, paths[0])}")
    return 0


main = partial(exit_code, "inspect", run)
