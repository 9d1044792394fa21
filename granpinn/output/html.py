"""HTML of records, as notebooks show it: a table and sentences, in the style of the notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """A table of texts; the first cell of a row is its name."""
    lines = ["<table>"]
    if head:
        cells = "".join(f"<th>{escape(text)}</th>" for text in head)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    for name, *texts in rows:
        cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
        lines.append(f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>')
    return "\n".join([*lines, "</table>"])


def paragraphs(sentences: Iterable[str]) -> str:
    """One paragraph for each sentence."""
    return "\n".join(f"<p>{escape(text)}</p>" for text in sentences)
