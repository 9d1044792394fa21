"""A page of a run as a reader or a browser sees it: text, elements, images."""

from __future__ import annotations

from html.parser import HTMLParser


class Page(HTMLParser):
    """
    Attributes:
        text: what is read, white space folded; `style` and `script` left out.
        tags: names of all elements, in order.
        attributes: (element, attribute, value) of all elements.
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self._text: list[str] = []
        self._in_style = False
        self.feed(html)
        self.close()
        self.text = " ".join("".join(self._text).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self._in_style = tag in {"style", "script"}
        if tag in {"td", "th", "dd"}:
            self._text.append(" ")

    def handle_endtag(self, tag: str) -> None:
        self._in_style = False

    def handle_data(self, data: str) -> None:
        if not self._in_style:
            self._text.append(data)

    def values(self, tag: str, attribute: str) -> list[str]:
        return [v for t, a, v in self.attributes if (t, a) == (tag, attribute)]
