"""The command `python -m granpinn.inspect`: quality of data and precision of the law from it.

Exit codes: 0 done; 2 bad input; 1 the results cannot be written.

In Python, `granpinn.inspect(flow)` gives the same numbers.
"""
# This folder has no __init__.py: a package would hide the module `inspect` of the standard library
# from code that runs in granpinn/.

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("inspect")

import argparse
import dataclasses
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command.callable_module import call_like
from granpinn.command.next_step import refusal, training_of
from granpinn.command.parser import Parser, program
from granpinn.config import ConfigError, SideWalls
from granpinn.config.fields import flag_of, settings_of
from granpinn.config.values import convert
from granpinn.data import FlowFileWarning, read_flow
from granpinn.data.reader import is_flow_file
from granpinn.data.steady import said
from granpinn.inspection import AssumedLaw, Inspection, inspect
from granpinn.output import make_folder, objection_to_folder, write_text
from granpinn.physics.law_values import PARAMETERS
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
# Arguments of a conversion besides the files; docs/guides/importing.md has the steps.


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    return exit_codes.exit_code("inspect", lambda: _run(sys.argv[1:] if argv is None else argv))


def _run(argv: Sequence[str]) -> int:
    options = parse(argv)
    _require_flow_file(options["data"])
    if len(options["data"]) > 1:
        return _several(options)
    data = options["data"][0]
    with warnings.catch_warnings():
        # Exact zeros have their own line in what is printed.
        warnings.simplefilter("ignore", FlowFileWarning)
        flow = read_flow(data)
    found = inspect(flow, options["law"], options["side_walls"])
    numbers = json.dumps(found.numbers(), indent=2, allow_nan=False)
    if options["out"] is not None:
        write(found, numbers, options["out"])
    if options["json"]:
        print(numbers)
        return 0
    if (mean := said(found.flow)) is not None:
        print(mean)
    elif found.flow.t.size < flow.t.size:
        print(
            f"large flow: measured in {found.flow.t.size} of {flow.t.size} frames, from t = "
            f"{found.flow.t[0]:.4g} to {found.flow.t[-1]:.4g}; checked in all"
        )
    print("\n".join(found.lines()))
    if options["out"] is not None:
        print(f"figures and inspect.json: {options['out']}")
    if found.slips:
        print("next: mend the flow file, or convert again with the right calibration")
    else:
        print(f"next: {training_of(flow, data)}")
    return 0


def _several(options: dict[str, Any]) -> int:
    if options["json"] or options["out"] is not None:
        raise ConfigError(
            f"expected one flow file with --json or --out, got {len(options['data'])}: inspect one "
            "at a time"
        )
    print("\n".join(expected.lines([read_flow(path) for path in options["data"]])))
    names = " ".join(map(str, options["data"]))
    print(f"next: {program('train')} {names} --one-law --out run")
    return 0


def parse(argv: Sequence[str]) -> dict[str, Any]:
    """Options of a command line: data, out, json, law and side_walls."""
    parser = Parser(
        prog=program("inspect"),
        usage="%(prog)s FLOW.h5 [FLOW.h5 ...] [--out DIR] [--json]",
        description="Inspect velocity data and estimate how precisely they fix the friction law.",
        epilog=EXAMPLES.replace("python -m granpinn.inspect", program("inspect")),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("data", metavar="FLOW.h5", type=Path, nargs="+", help="a flow file")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for figures and numbers")
    parser.add_argument("--json", action="store_true", help="print all numbers as JSON")
    for field in dataclasses.fields(AssumedLaw):
        text = f"{field.metadata['help']}; assumed for the expected precision"
        default = field.default if field.name == "law" else None
        flag = flag_of(field.name)
        parser.add_argument(flag, dest=field.name, metavar="X", default=default, help=text)
    for name, stated in settings_of(SideWalls).items():
        flag = flag_of(f"side_walls.{name}")
        default = str(stated.default)
        parser.add_argument(flag, dest=name, metavar="X", default=default, help=stated.help)
    values = vars(parser.parse_args(argv))
    given = {n: convert(values[n], float, f"--{n}") for n in PARAMETERS if values[n] is not None}
    try:
        law = AssumedLaw(law=values["law"], **given)
    except ValueError as error:
        raise ConfigError(f"the friction law is impossible: {error}") from None
    out = values["out"]
    if out is not None and (objection := objection_to_folder(out)):
        raise ConfigError(f"--out {objection}")
    friction = {name: _of_side_walls(name, values[name]) for name in settings_of(SideWalls)}
    side_walls = SideWalls(**friction)
    made = {"law": law, "side_walls": side_walls}
    return {key: values[key] for key in ("data", "out", "json")} | made


def _of_side_walls(name: str, text: Any) -> float:
    flag = flag_of(f"side_walls.{name}")
    value: float = convert(text, float, flag)
    settings_of(SideWalls)[name].check(value, flag)
    return value


def _require_flow_file(paths: list[Path]) -> None:
    """Raises an error for the files of an instrument, with the command that converts them."""
    first = paths[0]
    if not first.exists():
        raise ConfigError(f"{first} does not exist: name a flow file")
    if all(path.is_file() and is_flow_file(path) for path in paths):
        return
    raise refusal(paths, "inspect")


def write(found: Inspection, numbers: str, folder: Path) -> None:
    """Writes inspect.json and the figures to a folder, which is made if necessary."""
    from granpinn.figures.style import save  # matplotlib is slow to import

    make_folder(folder)
    write_text(folder / "inspect.json", numbers + "\n")
    for record in found.records.values():
        for name, (_, draw) in record.figures().items():
            save(draw(found).figure, folder / f"{name}.png")


call_like(inspect, "granpinn.inspect")

if __name__ == "__main__":
    sys.exit(main())
