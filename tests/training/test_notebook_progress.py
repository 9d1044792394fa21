"""The progress line of a notebook, with a stand-in for IPython."""

from __future__ import annotations

import re
import sys
from types import ModuleType

import pytest

from granpinn.data import Flow
from granpinn.identification.single import identify
from granpinn.physics.laws import DEFAULT
from granpinn.training import progress
from granpinn.training.history import Row, columns
from granpinn.training.progress import Silent
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
    identify(flow, tiny(steps=20, simulated_pressure__frames=0))
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


@pytest.mark.parametrize("shell", [None, Shell("TerminalIPythonApp")])
def test_other_places_show_nothing(
    shell: Shell | None, notebook: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: shell)
    assert type(progress.by_default()) is Silent
    monkeypatch.delitem(sys.modules, "IPython")
    assert type(progress.by_default()) is Silent


def test_a_notebook_is_not_flooded(notebook: Output) -> None:
    listener = progress.Notebook(every=1e9)
    listener.start(1000, 0)
    listener.total(900)
    for step in range(1, 901):
        listener.show(Row.of(DEFAULT, [step] + [0.5] * (len(columns(DEFAULT)) - 1)))
    assert len(notebook.contents) == 3  # the first, one row and the last
    assert notebook.contents[-1]["text/plain"].startswith("fit 900/900  mu_s")
    listener.stop()
    assert len(notebook.contents) == 4
    assert notebook.contents[-1]["text/plain"].startswith("done  mu_s")
