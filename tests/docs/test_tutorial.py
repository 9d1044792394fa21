"""The blocks of the tutorial run in order in one folder, with few steps of a small network."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import runpy
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "start" / "five-minutes.md"
BLOCK = re.compile(r"^<!-- (run|output) -->\n```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
STEPS = "--steps 6000"
SMALL = "--steps 40 --network.widths 16,16 --checks none"


@dataclass(frozen=True)
class Block:
    """A block of the page: to `run` in its language, or the `output` of the block before."""

    kind: str
    language: str
    text: str


def blocks() -> list[Block]:
    return [Block(*match.groups()) for match in BLOCK.finditer(PAGE.read_text())]


def run(block: Block, folder: Path) -> str:
    """What a block prints; it fails if the block does."""
    text = block.text.replace(STEPS, SMALL)
    if block.language == "python":  # in this process, which has loaded the libraries
        with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.chdir(folder):
            Path("block.py").write_text(text)
            runpy.run_path("block.py", run_name="__main__")
        return printed.getvalue()
    command = ["bash", "-euo", "pipefail", "-c", text]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PATH": path}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{block.text}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.timeout(400)  # 30 s on a core of its own
def test_tutorial_from_files_to_report(tmp_path: Path) -> None:
    found = blocks()
    assert [block.kind for block in found].count("run") == 5
    assert sum(block.text.count(STEPS) for block in found) == 1
    printed = ""
    for block in found:
        if block.kind == "output":
            assert printed.strip() == block.text.strip()
        else:
            printed = run(block, tmp_path)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000
    result = json.loads((tmp_path / "run" / "results.json").read_text())
    assert result["data"]["n_frames"] == 100
    assert printed.startswith("mu_s = ")  # the last block, in Python
