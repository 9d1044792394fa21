"""The navigation of mkdocs.yml, completed: every page of docs/ is in it, once.

A section takes the pages of the folder with its name: those of docs/evidence/ that mkdocs.yml does
not list come at the end of the section Evidence, by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any


def on_config(config: Any) -> Any:
    """Called by mkdocs before anything else."""
    config.nav = completed(config.nav, pages(Path(config.docs_dir)))
    return config


def pages(docs: Path) -> list[str]:
    """Every page below `docs`, such as "start/install.md"."""
    return sorted(path.relative_to(docs).as_posix() for path in docs.rglob("*.md"))


def completed(nav: list[Any], pages: list[str]) -> list[Any]:
    """`nav` with the missing ones of `pages` in the sections of their folders; no empty section."""
    missing = [page for page in pages if page not in set(listed(nav))]
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
