"""The notebooks of examples/: they run with few steps, and the site shows their last outputs."""

from __future__ import annotations

import base64
import runpy
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib import pyplot

from granpinn.data import read_flow, write_flow
from granpinn.simulation import demo_path
from tests.docs.test_site import hook
from tests.notebooks import NOTEBOOKS, cells, program
from tests.runs import TINY


@pytest.fixture(scope="module")
def small_flow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The collapse that comes with granpinn, with every fourth frame, row and column."""
    flow = read_flow(demo_path())
    some = slice(None, None, 4)
    parts = {name: getattr(flow, name)[some] for name in "tyx"}
    parts |= {name: getattr(flow, name)[some, some, some] for name in "uvcp"}
    path = tmp_path_factory.mktemp("notebooks") / "collapse.h5"
    write_flow(replace(flow, **parts), path)
    return path


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(
    path: Path, small_flow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one program, with the cell of its settings replaced by a small flow and a tiny network."""
    tiny = TINY
    settings = {"flow_file": str(small_flow), "run_dir": str(tmp_path / "run"), "settings": tiny}
    settings |= {"members": 2}
    code = tmp_path / f"{path.stem}.py"
    code.write_text(program(path, settings), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    try:
        names = runpy.run_path(str(code))
        assert pyplot.get_fignums()
    finally:
        pyplot.close("all")
    assert names["result"].timing.steps == TINY["steps"]
    assert repr(names["result"]).startswith("Identification(")
    assert "<table>" in names["result"]._repr_html_()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_holds_its_last_run(path: Path) -> None:
    """Every cell was run, in order and without an error."""
    ran = cells(path, "code")
    assert [cell["execution_count"] for cell in ran] == [*range(1, len(ran) + 1)]
    outputs = [output for cell in ran for output in cell["outputs"]]
    assert not [output for output in outputs if output["output_type"] == "error"]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    assert path.stat().st_size < 600_000
    text = path.read_text(encoding="utf-8")
    assert not [folder for folder in ("/home/", "/tmp/", "/root/") if folder in text]


def test_a_page_has_text_code_tables_and_figures() -> None:
    notebooks = hook("notebooks")
    made = {
        "cells": [
            {"cell_type": "markdown", "source": ["# Title\n", "text"]},
            {
                "cell_type": "code",
                "source": ["a\n", "b"],
                "outputs": [
                    {"name": "stdout", "text": ["one\n", "two\n"]},
                    {"data": {"text/html": ["<table>", "</table>"], "text/plain": ["no"]}},
                    {"data": {"text/html": ["<div>no</div>"], "text/plain": ["yes"]}},
                    {"data": {"image/png": base64.b64encode(b"png").decode(), "text/plain": []}},
                ],
            },
        ]
    }
    assert notebooks.rendered("a_b", made) == (
        "# Title\ntext\n\n```python\na\nb\n```\n\n```text\none\ntwo\n```\n\n"
        '<div class="output">\n<table></table>\n</div>\n\n```text\nyes\n```\n\n![](a-b-1.png)\n'
    )
    assert [*notebooks.images("a_b", made)] == [("a-b-1.png", b"png")]
