"""The page in a real browser: it fits a phone, logs no error, and prints."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.report import browser as browsers
from tests.report.browser import Browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    program = browsers.find()
    if program is None:
        pytest.skip("no Chromium is installed: the page was not opened in a browser")
    started = Browser(program, tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


@pytest.fixture
def page(browser: Browser, built: Path) -> Iterator[Path]:
    """The page; a test fails if the browser complains or asks for anything but the page."""
    browser.complaints.clear()
    browser.requests.clear()
    path = built / "report.html"
    yield path
    assert browser.complaints == []
    assert set(browser.requests) <= {path.as_uri()}


@pytest.mark.parametrize("width", [360, 1280])
def test_the_page_fits(browser: Browser, page: Path, width: int) -> None:
    browser.open(page, width)
    root = "document.documentElement"
    assert browser.evaluate("innerWidth") == width
    assert browser.evaluate(f"{root}.scrollWidth") <= width
    picture = browser.picture()
    assert width - 20 <= picture.shape[1] <= width  # a scroll bar beside it
    assert picture.shape[0] > 2000
    assert picture.std() > 10  # not an empty page
    # Nothing is wider than the window unless it scrolls by itself.
    wide = browser.evaluate(
        "Array.from(document.querySelectorAll('main *'))"
        f".filter(e => e.getBoundingClientRect().right > {width} + 0.5 && !e.closest('.scroll'))"
        ".map(e => e.tagName + '.' + e.className)"
    )
    assert wide == []
