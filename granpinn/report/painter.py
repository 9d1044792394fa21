"""The program of one process that draws figures (painters.py): `python -m granpinn.report.painter
DIR`.

It loads its libraries at once, reads the name of a figure a line, draws that figure of the run
folder, and answers with one line of JSON: its caption and its narrow PNG in base64, or null if it
cannot be drawn. It ends with its input.
"""

from __future__ import annotations

import base64
import json
import sys
from pathlib import Path

from granpinn.figures import album
from granpinn.report import page
from granpinn.results import NotDone


def main() -> None:
    folder = Path(sys.argv[1])
    source: album.Source | None = None
    for line in sys.stdin:
        source = source or page.read(folder)[0]
        made = album.draw_one(source, folder / "figures", line.strip())
        answer = None
        if not isinstance(made, NotDone):
            phone = base64.b64encode(made.phone).decode("ascii")
            answer = {"caption": made.caption, "phone": phone}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
