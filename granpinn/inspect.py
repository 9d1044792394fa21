"""The command `python -m granpinn.inspect`: what data can answer, before any training.

Exit codes: 0 done; 2 bad input; 1 the results cannot be written.

In Python, `granpinn.inspection.inspect(flow)` gives the same numbers.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.atomic import atomic_path
from granpinn.command.parser import Parser, fail
from granpinn.config import ConfigError
from granpinn.config.toml import convert
from granpinn.data import FlowFileError, FlowFileWarning, read_flow
from granpinn.importers import DataFileError
from granpinn.importers.formats import detect, is_flow_file
from granpinn.inspection import Inspection, Law, inspect
from granpinn.inspection.text import lines_of
from granpinn.uncertainty.of_data import verdict

EXAMPLES = """examples:
  python -m granpinn.inspect flow.h5
      numbers and a verdict
  python -m granpinn.inspect flow.h5 --out inspection
      and inspect.json with maps of the gaps, the speed, the noise and the inertial numbers
  python -m granpinn.inspect flow.h5 --I0 0.28 --mu-s 0.3 --mu-2 0.6
      the precision for a material that is roughly known"""
# What converting needs beyond the files; docs/importing.md has the steps for every instrument.
CONVERT = (
    '--out flow.h5 --scale "0.12 mm/px" --frame-rate "500 Hz" --grain-diameter "0.8 mm" '
    '--grain-density "2500 kg/m^3" --solid-fraction 0.6'
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""
    try:
        options = parse(sys.argv[1:] if argv is None else argv)
        _require_flow_file(options["data"])
        data = options["data"][0]
        with warnings.catch_warnings():
            # Exact zeros have their own line in what is printed.
            warnings.simplefilter("ignore", FlowFileWarning)
            flow = read_flow(data)
        found = inspect(flow, options["law"])
        numbers = found.numbers() | {"verdict": verdict(found)}
        if options["out"] is not None:
            write(found, numbers, options["out"])
    except (ConfigError, DataFileError, FlowFileError) as error:
        return fail("inspect", 2, str(error))
    except OSError as error:
        return fail("inspect", 1, str(error))
    if options["json"]:
        print(json.dumps(numbers, indent=2, allow_nan=False))
        return 0
    print("\n".join(lines_of(found)))
    if options["out"] is not None:
        print(f"figures and inspect.json: {options['out']}")
    print(f"next: python -m granpinn.train {data} --out run")
    return 0


def parse(argv: Sequence[str]) -> dict[str, Any]:
    """data, out, json and law of a command line."""
    default = Law()
    parser = Parser(
        prog="python -m granpinn.inspect",
        usage="%(prog)s FLOW.h5 [--out DIR] [--json]",
        description="Say what data can tell about the friction law, without any training.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("data", metavar="FLOW.h5", type=Path, nargs="+", help="a flow file")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for figures and numbers")
    parser.add_argument("--json", action="store_true", help="print all numbers as JSON")
    for name in ("mu_s", "mu_2", "I0"):
        text = f"assumed for the expected precision (default {getattr(default, name):g})"
        flag = "--" + name.replace("_", "-")
        parser.add_argument(flag, dest=name, metavar="X", default=None, help=text)
    values = vars(parser.parse_args(argv))
    given = {
        n: convert(values.pop(n), float, f"--{n}") for n in ("mu_s", "mu_2", "I0") if values[n]
    }
    law = Law(**given)
    if not all(math.isfinite(x) and x > 0 for x in vars(law).values()) or law.mu_2 <= law.mu_s:
        raise ConfigError(
            f"the friction law must have 0 < mu_s < mu_2 and I0 > 0, got mu_s = {law.mu_s:g}, "
            f"mu_2 = {law.mu_2:g}, I0 = {law.I0:g}: correct --mu-s, --mu-2 or --I0"
        )
    out = values["out"]
    if out is not None and out.exists() and not out.is_dir():
        raise ConfigError(f"--out must be a folder, got {out}: name another")
    return {key: values[key] for key in ("data", "out", "json")} | {"law": law}


def _require_flow_file(paths: list[Path]) -> None:
    """Refuses files of an instrument with the command that converts them."""
    first = paths[0]
    if not first.exists():
        raise ConfigError(f"{first} does not exist: name a flow file")
    if first.is_file() and is_flow_file(first):
        if len(paths) > 1:
            raise ConfigError(f"expected one flow file, got {len(paths)}: inspect one at a time")
        return
    name = detect(first)
    sources = str(first) if len(paths) == 1 else f"{first} ... {paths[-1]}"
    raise DataFileError(
        f"{first} is not a flow file but of the format {name}: convert it first, python -m "
        f"granpinn.convert {sources} {CONVERT} (with your own numbers), and inspect flow.h5"
    )


def write(found: Inspection, numbers: dict[str, Any], folder: Path) -> None:
    """inspect.json and the figures, to a folder that is made."""
    from granpinn.figures.inspection import save_figures  # matplotlib is slow to import

    folder.mkdir(parents=True, exist_ok=True)
    with atomic_path(folder / "inspect.json") as path:
        path.write_text(json.dumps(numbers, indent=2, allow_nan=False) + "\n")
    save_figures(found, folder)


if __name__ == "__main__":
    sys.exit(main())
