"""Fills values into the Markdown files, so that a number has one source.

A pair of comments holds a value. A reader on GitHub sees only the value:

    mu(I) was within <!--n:grains.mu-->-1.0 to +1.0<!--/n--> %.

`NUMBERS` (sources.py) has the names, the raw results and the computations. Names of `BUILT` are
long references, made from the code when the site is built; in the files their pairs are empty.

    python -m docs.generate.numbers --check    # says which values are stale; .ci/run calls this
    python -m docs.generate.numbers --write    # fills them in
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
if str(ROOT) not in sys.path:  # mkdocs loads a hook by its path
    sys.path.insert(0, str(ROOT))

from docs.generate import commands, error_model, reliability, settings  # noqa: E402
from docs.generate.sources import NUMBERS  # noqa: E402

PAGES = ("*.md", "docs/**/*.md", "bench/studies/**/*.md")
PAIR = re.compile(r"<!--n:([\w.]+)-->(.*?)<!--/n-->", re.DOTALL)
BUILT: dict[str, Callable[[], str]] = {
    "commands": commands.reference,
    "settings": settings.reference,
    "recipes": settings.recipe_table,
    "error_model.table": error_model.table,
    "gates": reliability.gate_table,
    "records": reliability.record_tables,
}


class UnknownNumberError(Exception):
    """A page has a name that neither `NUMBERS` nor `BUILT` has."""


def filled(text: str, values: dict[str, Callable[[], str]]) -> str:
    """`text` with the values of all names in `values`; raises UnknownNumberError."""

    def pair(match: re.Match[str]) -> str:
        name = match[1]
        if name not in NUMBERS and name not in BUILT:
            raise UnknownNumberError(f"{name} is not in NUMBERS of docs/generate/sources.py")
        if name not in values:
            return match[0]
        value = values[name]()
        value = f"\n\n{value}\n\n" if "\n" in value else value  # a table, or a block
        return f"<!--n:{name}-->{value}<!--/n-->"

    return PAIR.sub(pair, text)


def pages(root: Path = ROOT) -> list[Path]:
    """The Markdown files that may hold values."""
    return sorted(path for pattern in PAGES for path in root.glob(pattern))


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Called by mkdocs: the references of `BUILT` in their places."""
    return filled(markdown, BUILT)


def main(argv: list[str] | None = None) -> int:
    """Exit code 1 if a value was stale and only `--check` was asked for."""
    parser = argparse.ArgumentParser(description="Numbers of the documentation.")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--check", action="store_true", help="say which files are stale")
    action.add_argument("--write", action="store_true", help="fill the values in")
    write = parser.parse_args(argv).write
    stale = 0
    for path in pages():
        before = path.read_text(encoding="utf-8")
        after = filled(before, NUMBERS)
        if after == before:
            continue
        stale += 1
        pairs = zip(PAIR.finditer(before), PAIR.finditer(after), strict=True)
        names = sorted({old[1] for old, new in pairs if old[2] != new[2]})
        print(f"{path.relative_to(ROOT)}: {', '.join(names)}")
        if write:
            path.write_text(after, encoding="utf-8")
    if stale and not write:
        print("stale; python -m docs.generate.numbers --write fills them in")
    return int(bool(stale) and not write)


if __name__ == "__main__":
    sys.exit(main())
