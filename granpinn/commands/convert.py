"""The command `python -m granpinn.convert`: makes a flow file of the files of a PIV or PTV program.

Exit codes: 0 done; 2 bad or impossible input, without --force; 1 the flow file cannot be written.

In Python, `granpinn.read(files, ...)` gives the flow, and `granpinn.convert(files, settings)` takes
the settings as a record.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("convert")

from collections.abc import Sequence
from functools import partial

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.flow_files import add_arguments, parse, write
from granpinn.commands.shared.parser import Parser
from granpinn.config import settings_of
from granpinn.importers import Settings, convert
from granpinn.importers.series import FORMATS

EXAMPLES = """examples:
  python -m granpinn.convert run/PIVlab_*.txt --out flow.h5 --scale "0.12 mm/px" \\
      --frame-rate "500 Hz" --grain-diameter "0.8 mm" --grain-density "2500 kg/m^3" \\
      --solid-fraction 0.6
      vectors in pixels per frame, one file per frame, a mask drawn in PIVlab
  python -m granpinn.convert tracks.csv --out flow.h5 --surface surface.csv --scale "8.3 px/mm" ...
      tracked particles: velocities by local polynomials; the line of the free surface by hand
  python -m granpinn.convert B*.txt --out flow.h5 --tilt "-1.2 deg" --wall-gap "20 mm" ...
      text of DaVis, already in mm and m/s; a plumb line in the image leans 1.2 degrees to the left
  python -m granpinn.convert out-*.txt --out flow.h5 --dimensionless --times name \\
      --grain-diameter 0.025
      a simulation without units, times in the names of the files

units: any that make sense ("0.12 mm/px", "8.3 px/mm", "2 ms", "2.5 g/cm^3"); the flow file has SI.
What is missing is named. docs/guides/importing.md has the steps for every instrument."""


def parser() -> Parser:
    formats = "\n".join(f"  {name:<12}{found.title}" for name, found in FORMATS.items())
    made = Parser(
        "convert",
        "IN... --out FLOW.h5 [settings]",
        "Turn files of a PIV, PTV or simulation program into a flow file.",
        f"{EXAMPLES}\n\nformats:\n{formats}",
    )
    add_arguments(made, "files, folders or patterns", settings_of(Settings))
    return made


def run(argv: Sequence[str]) -> int:
    sources, out, given = parse(parser(), argv)
    settings = Settings(**given)
    write(convert(sources, settings, report=print), out, settings.force)
    return 0


main = partial(exit_code, "convert", run)
