"""The navigation of mkdocs.yml, completed: every page is in it, once.

A section takes the pages of the folder with its name that mkdocs.yml does not list: index.md first,
the others by name. They come at its end, or in its subsection that mkdocs.yml leaves empty, such as
the notes of the studies in Evidence.
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
            name: with_pages(part, [p for p in missing if p.startswith(f"{name.lower()}/")])
            if isinstance(part, list)
            else part
            for name, part in item.items()
        }
        for item in nav
    ]
    return [item for item in filled if any(item.values())]


def with_pages(section: list[Any], pages: list[str]) -> list[Any]:
    """A section with more pages, in its empty subsection if it has one."""
    last = section[-1] if section else None
    if not isinstance(last, dict) or any(last.values()):
        return [*section, *pages]
    return [*section[:-1], *([dict.fromkeys(last, pages)] if pages else [])]


def listed(nav: list[Any]) -> Iterator[str]:
    """The pages of a navigation, in its order."""
    for item in nav:
        for page in item.values() if isinstance(item, dict) else [item]:
            if isinstance(page, list):
                yield from listed(page)
            else:
                yield page
