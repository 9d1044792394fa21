"""The block of the page "Bring your law" runs, with few steps, a small network and a small flow."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from granpinn.data import write_flow
from tests.flows import make_flow

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "own-law.md"
FEWER = "steps=5, network__widths=(8, 8)"
BLOCK = re.compile(r"^<!-- run -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_the_law_of_the_page_is_identified(tmp_path: Path) -> None:
    (text,) = BLOCK.findall(PAGE.read_text())
    assert text.count("steps=20000") == 1
    write_flow(make_flow(), tmp_path / "flow.h5")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", text.replace("steps=20000", FEWER)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^b +[0-9.]+ ", done.stdout, re.MULTILINE)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000
