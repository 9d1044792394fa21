"""The page in a real browser: it fits a phone, logs no error, and its slider works."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.report import browser as browsers
from tests.report.browser import Browser

WIDTHS = (360, 1280)
SHOWN = "document.getElementById('film').dataset.shown"


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


def start(browser: Browser, page: Path, width: int = 800) -> None:
    browser.open(page, width)
    browser.wait_for(SHOWN)


@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_fits(browser: Browser, page: Path, width: int) -> None:
    start(browser, page, width)
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


def test_the_slider_moves_the_picture(browser: Browser, page: Path) -> None:
    start(browser, page)
    seen = {}
    last = browser.evaluate("Number(document.querySelector('#time').max)")
    for k in (0, last, 0):
        browser.evaluate(
            f"(() => {{ const s = document.querySelector('#time'); s.value = {k};"
            " s.dispatchEvent(new Event('input', {bubbles: true})); })()"
        )
        browser.wait_for(f"{SHOWN} === '{k}'")
        picture = browser.picture("#film canvas")
        if k in seen:
            np.testing.assert_array_equal(picture, seen[k])
        seen[k] = picture
    assert np.mean(np.any(seen[0] != seen[last], axis=-1)) > 0.05
    text = browser.evaluate("document.querySelector('#film .now').textContent")
    assert text.startswith("pressure at t = ")


def test_the_canvas_shows_what_the_still_shows(browser: Browser, page: Path) -> None:
    start(browser, page)
    moving = browser.picture(".screen").astype(float)
    browser.open(page, 800, scripts=False)
    still = browser.picture(".screen").astype(float)
    assert moving.shape == still.shape
    assert np.abs(moving - still).mean() < 2.0  # resampling may differ, of 255


def test_without_scripts_there_is_a_still_and_no_dead_control(browser: Browser, page: Path) -> None:
    browser.open(page, 360, scripts=False)
    assert browser.evaluate("document.querySelector('.still').offsetHeight") > 50
    assert browser.evaluate("document.querySelector('.still').naturalWidth") > 1
    for selector in (".controls", "#film canvas"):
        assert browser.evaluate(f"document.querySelector('{selector}').offsetHeight") == 0
    assert browser.evaluate("document.documentElement.scrollWidth") <= 360
