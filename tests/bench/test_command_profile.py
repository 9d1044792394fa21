"""The seconds of the command."""

from __future__ import annotations

import sys

from bench import command_profile

SLOW = "import time; print('heading', flush=True); time.sleep({}); print('mu_s 0.4', flush=True)"


def test_the_answer_comes_between_the_first_line_and_the_exit() -> None:
    found = command_profile.timed([sys.executable, "-c", SLOW.format(0.2)])
    assert 0 < found["first_line_s"] <= found["answer_s"] - 0.15 < found["exit_s"]
    assert found["cpu_s"] > 0
