"""Peak memory of one step beyond its inputs, measured in a process of its own."""

from __future__ import annotations

from pathlib import Path

import torch

from bench.steps import STEPS, make_task
from bench.studies.cores import alone

STATUS = Path("/proc/self/status")


def kilobytes(name: str) -> int:
    """A size of this process, as Linux names it: VmRSS, VmHWM, RssAnon."""
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1])


def peak(form: str, step: str, points: int) -> float:
    """Megabytes that a step adds to the resident memory after its inputs are loaded (Linux)."""
    torch.set_num_threads(1)
    warm_up = STEPS[step](make_task(form, 32))
    warm_up()
    advance = STEPS[step](make_task(form, points))
    Path("/proc/self/clear_refs").write_text("5")  # resets the high-water mark
    before = kilobytes("VmRSS")
    advance()
    return round((kilobytes("VmHWM") - before) / 1024, 2)


def peak_in_process(form: str, step: str, points: int) -> float:
    return alone(peak, form, step, points)
