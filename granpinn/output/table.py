"""A table of texts, as a terminal and a notebook show it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple


class Table(NamedTuple):
    """Texts in columns; the first cell of a row is its name.

    Attributes:
        head: of the columns; (): without one.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    def lines(self) -> list[str]:
        """The lines for a terminal: names to the left, other cells to the right."""
        every = [row for row in (self.head, *self.rows) if row]
        wide = [max(map(len, column)) for column in zip(*every, strict=True)]
        return [
            "  ".join([row[0].ljust(wide[0]), *map(str.rjust, row[1:], wide[1:])]).rstrip()
            for row in every
        ]

    def html(self) -> str:
        """The table in the style of the notebook; text is no markup."""
        head = "".join(f"<th>{escape(text)}</th>" for text in self.head)
        lines = ["<table>", *([f"<thead><tr>{head}</tr></thead>"] if head else [])]
        for name, *texts in self.rows:
            cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
            lines.append(f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>')
        return "\n".join([*lines, "</table>"])


def paragraph(text: str) -> str:
    """A paragraph of HTML."""
    return f"<p>{escape(text)}</p>"
