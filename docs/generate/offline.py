"""A page that loads anything from elsewhere is an error of the strict build."""

from __future__ import annotations

import logging
from html.parser import HTMLParser
from typing import Any

log = logging.getLogger("mkdocs.hooks.offline")
LOADING = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Looks at a page as it is written."""
    for address in loaded(output):
        log.warning("%s loads %s: keep a copy in docs/", page.file.src_uri, address)
    return output


def loaded(output: str) -> list[str]:
    """The addresses on other hosts that a browser loads to show a page."""
    finder = _Finder()
    finder.feed(output)
    return finder.found


class _Finder(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        address = dict(attrs).get(LOADING.get(tag, "")) or ""
        if address.startswith(("http:", "https:", "//")):
            self.found.append(address)
