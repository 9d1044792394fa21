"""The program of one process that draws figures (painters.py): `python -m granpinn.report.painter
DIR`.

It loads its libraries at once, reads the name of a figure a line, draws that figure of the run
folder, and answers with one line of JSON: its title, its caption and its narrow PNG in base64, or
null if it cannot be drawn. To an empty line it answers with the names of all figures. It ends with
its input.
"""

from __future__ import annotations

import base64
import json
import sys
from pathlib import Path

from granpinn.figures import album
from granpinn.report import page
from granpinn.report.painters import NAMES
from granpinn.results import NotDone, read_results


def main() -> None:
    folder = Path(sys.argv[1])
    source: album.Source | None = None
    for line in map(str.strip, sys.stdin):
        answer: dict[str, str] | list[str] | None = None
        if line == NAMES:
            known = album.Source(read_results(folder / "results.json"), None, None, 0)
            answer = list(album.titles(known))
        else:
            source = source or page.read(folder)[0]
            made = album.draw_one(source, folder / "figures", line)
            if not isinstance(made, NotDone):
                phone = base64.b64encode(made.phone).decode("ascii")
                answer = {"title": made.title, "caption": made.caption, "phone": phone}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
