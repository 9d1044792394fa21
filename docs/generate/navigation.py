"""The navigation of mkdocs.yml, completed: every page is in it, once.

A section takes the pages of the folder with its name. The pages of evidence/ that mkdocs.yml does
not list come at the end of the section Evidence: its index.md first, the others by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def on_files(files: Any, config: Any) -> Any:
    """Called by mkdocs with all pages, those from outside docs/ too."""
    config.nav = completed(config.nav, [file.src_uri for file in files.documentation_pages()])
    return files


def completed(nav: list[Any], pages: list[str]) -> list[Any]:
    """`nav` with the missing ones of `pages` in the sections of their folders; no empty section."""
    missing = sorted(set(pages) - set(listed(nav)), key=lambda p: (not p.endswith("/index.md"), p))
    filled = [
        {
            name: [*part, *(page for page in missing if page.startswith(f"{name.lower()}/"))]
            if isinstance(part, list)
            else part
            for name, part in item.items()
        }
        for item in nav
    ]
    return [item for item in filled if any(item.values())]


def listed(nav: list[Any]) -> Iterator[str]:
    """The pages of a navigation, in its order."""
    for item in nav:
        for page in item.values() if isinstance(item, dict) else [item]:
            if isinstance(page, list):
                yield from listed(page)
            else:
                yield page
