"""The command `python -m granpinn.film`: makes a flow file of the frames of a film.

Exit codes: 0 done; 2 bad or impossible input, without --force; 1 the flow file cannot be written.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("film")

from collections.abc import Sequence
from functools import partial

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.flow_files import add_arguments, parse, write
from granpinn.commands.shared.parser import Parser
from granpinn.filming import SETTINGS, film

EXAMPLES = """examples:
  python -m granpinn.film frames/*.png --out flow.h5 --scale "0.12 mm/px" --frame-rate "1500 Hz" \\
      --grain-diameter "0.8 mm" --grain-density "2500 kg/m^3" --solid-fraction 0.6
  python -m granpinn.film film.avi --out flow.h5 --roi 40:900,0:400 --mask walls.png ...

It writes FLOW.html too: pictures of every stage. docs/guides/films.md shows them.
--tilt auto takes a straight floor in the picture as level."""


def parser() -> Parser:
    made = Parser(
        "film",
        "IN... --out FLOW.h5 [settings]",
        "Track the grains of a film and write a flow file.",
        EXAMPLES,
    )
    add_arguments(made, "images, or one video", SETTINGS)
    return made


def run(argv: Sequence[str]) -> int:
    sources, out, given = parse(parser(), argv)
    page = out.with_suffix(".html")
    flow = film(sources, page=page, report=print, **given)
    print(f"pictures of every stage: {page}")
    write(flow, out, given.get("force", False))
    return 0


main = partial(exit_code, "film", run)
