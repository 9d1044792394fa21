"""The blocks of guides in Python run, with few steps, a small network and a small flow."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import torch

import granpinn
from granpinn.data import write_flow
from tests.flows import make_flow

GUIDES = Path(__file__).parents[2] / "docs" / "guides"
FEWER = "steps=5, network__widths=(8, 8)"
BLOCK = re.compile(r"^<!-- run -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_the_law_of_the_page_is_identified(tmp_path: Path) -> None:
    (text,) = BLOCK.findall((GUIDES / "own-law.md").read_text())
    assert text.count("steps=6000") == 1
    write_flow(make_flow(), tmp_path / "flow.h5")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", text.replace("steps=6000", FEWER)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^b +[0-9.]+$", done.stdout, re.MULTILINE)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


def test_a_step_of_another_equation_changes_the_network(tmp_path: Path) -> None:
    (text,) = BLOCK.findall((GUIDES / "other-equations.md").read_text())
    program = tmp_path / "step.py"
    program.write_text(text)
    found = runpy.run_path(str(program))
    net = found["net"]
    before = granpinn.SwishNetwork(1, (64, 64, 64), (-1, 0, 0), (1, 0, 1))
    assert found["residual"].shape == (2048, 1)
    assert not torch.equal(net.params, before.params)
