"""The search of the site, opened from files in a browser."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.test_site import DOCS, ROOT, settings
from tests.report import browser as browsers

SCRIPTS = settings()["extra"]["polyfills"]
RESULTS = "Array.from(document.querySelectorAll('.md-search-result__item a')).map((a) => a.href)"
FOCUS = "document.querySelector('.md-search__input').focus()"


def test_the_index_is_a_script_and_so_is_the_worker() -> None:
    plugins = settings()["plugins"]
    assert plugins.index("search") < plugins.index("offline")
    # The plugin loads the script from another host, unless one of this name is given.
    assert [name for name in SCRIPTS if "iframe-worker" in name]
    assert all((DOCS / name).is_file() for name in SCRIPTS)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of three of our pages, with the theme, the search and the scripts of mkdocs.yml."""
    pytest.importorskip("material", reason="the extra `docs` is not installed")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    folder = tmp_path_factory.mktemp("site")
    pages = ("guides/error-bars.md", "guides/running.md", "reference/flow-file.md")
    for name in ("index.md", "images/result.png", *pages, *SCRIPTS):
        (folder / "docs" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(DOCS / name, folder / "docs" / name)
    ours = settings()
    config = load_config(
        str(ROOT / "mkdocs.yml"),
        docs_dir=str(folder / "docs"),
        site_dir=str(folder / "site"),
        nav=["index.md", *pages],
        plugins=[name for name in ours["plugins"] if name in ("search", "offline")],
        hooks=[],
        validation={"links": {"not_found": "ignore", "anchors": "ignore"}},
    )
    build(config)
    return folder / "site"


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[browsers.Browser]:
    program = browsers.find()
    if program is None:
        pytest.skip("there is no Chromium")
    opened = browsers.Browser(program, tmp_path)
    yield opened
    opened.close()


@pytest.mark.parametrize("page", ["index.html", "guides/running.html"])
def test_a_query_finds_pages(site: Path, browser: browsers.Browser, page: str) -> None:
    browser.open(site / page, 1200)
    browser.evaluate(FOCUS)
    browser.call("Input.insertText", text="strictly increasing")
    browser.wait_for(f"{RESULTS}.length > 0")
    found = browser.evaluate(RESULTS)
    assert all(address.startswith(site.as_uri()) for address in found)
    assert [address for address in found if "reference/flow-file.html" in address]
    assert browser.complaints == []
    assert all(address.startswith(("file:", "about:")) for address in browser.requests)
