"""The progress line of a notebook, with a stand-in for IPython."""

from __future__ import annotations

import re
import sys
from types import ModuleType

import pytest

from granpinn.data import Flow
from granpinn.identification.identify import identify
from tests.runs import tiny


class Shell:
    """What IPython says of the place where code runs."""

    def __init__(self, *applications: str) -> None:
        self.config = dict.fromkeys(applications)


class Output:
    """The output of a cell: the content of its only display."""

    def __init__(self) -> None:
        self.contents: list[dict[str, str]] = []

    def display(self, content: dict[str, str], *, raw: bool, display_id: bool) -> Output:
        assert raw
        assert display_id
        assert not self.contents
        self.contents.append(content)
        return self

    def update(self, content: dict[str, str], *, raw: bool) -> None:
        assert raw
        self.contents.append(content)


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Output:
    output, package = Output(), ModuleType("IPython")
    package.get_ipython = lambda: Shell("IPKernelApp")  # type: ignore[attr-defined]
    package.display = output  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", package)
    return output


def test_a_notebook_shows_one_line_without_being_asked(flow: Flow, notebook: Output) -> None:
    identify(flow, tiny(steps=20))
    first, last = notebook.contents[0], notebook.contents[-1]
    assert first == {
        "text/plain": "fit 0/20",
        "text/html": '<progress value="0.000" max="1"></progress> fit 0/20',
    }
    assert re.fullmatch(r"done  mu_s 0\.\d{4}  mu_2 .*loss .*", last["text/plain"])
    assert "left" not in last["text/plain"]
    assert '<progress value="1.000" max="1">' in last["text/html"]
    names = [content["text/plain"].split()[0] for content in notebook.contents]
    assert list(dict.fromkeys(names)) == ["fit", "last", "error", "checks", "done"]
