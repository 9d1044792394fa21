"""Formulas in LaTeX, `$...$` and `$$...$$`, as MathML: browsers show it without a script."""

from __future__ import annotations

import html
import re
from typing import Any

_FORMULA = re.compile(
    r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>',
    re.DOTALL,
)


def on_page_content(content: str, page: Any, config: Any, files: Any) -> str:
    """Replaces what the extension arithmatex leaves for a script."""
    return _FORMULA.sub(formula, content)


def formula(match: re.Match[str]) -> str:
    """One formula: in its line, or a block of its own that scrolls where it is too wide."""
    from latex2mathml.converter import convert  # tests use this module without the extra `docs`

    latex = html.unescape(match[2]).strip()
    if match[1] == "span":
        return str(convert(latex))
    return f'<div style="overflow-x: auto">{convert(latex, display="block")}</div>'
