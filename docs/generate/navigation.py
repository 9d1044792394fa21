"""The navigation of mkdocs.yml, completed: every page of docs/ is in it, once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

REST = "How to"  # the section of pages that mkdocs.yml does not list


def on_config(config: Any) -> Any:
    """Called by mkdocs before anything else."""
    pages = sorted(path.name for path in Path(config.docs_dir).glob("*.md"))
    config.nav = completed(config.nav, pages)
    return config


def completed(nav: list[Any], pages: list[str]) -> list[Any]:
    """`nav` with the missing ones of `pages` at the end of its section for the rest."""
    missing = [page for page in pages if page not in set(listed(nav))]
    return [
        {REST: [*item[REST], *missing]} if isinstance(item, dict) and REST in item else item
        for item in nav
    ]


def listed(nav: list[Any]) -> Iterator[str]:
    """The pages of a navigation, in its order."""
    for item in nav:
        for page in item.values() if isinstance(item, dict) else [item]:
            if isinstance(page, list):
                yield from listed(page)
            else:
                yield page
