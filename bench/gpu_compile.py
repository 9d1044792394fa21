"""What torch.compile takes minutes for, one after another, compiled ahead and side by side.

    python -m bench.gpu_compile --rival NAME --form strong --points 512

makes one step; its kernels are then in torch's cache on the disk, from where bench/gpu_step.py gets
them, which starts one such process for each row. Which launch configuration of a kernel is the
fastest is not kept: that is for the measurement to find, which has the GPU to itself.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import torch

from bench.processes import NO_TIME, run_lines
from bench.rivals import FUNCTIONAL, OTHER_RIVALS, QUICK_RIVALS, Rival, Sizes
from bench.steps import make_task

THREADS = "2"  # of each process: they are many


@contextmanager
def compiling(
    some: list[Rival], sizes: Sizes, device: torch.device, seconds: float
) -> Iterator[dict[str, Any]]:
    """Compiles some rivals while the block runs, which measures no time; then waits for them.

    Yields:
        what becomes the record of it: rows, seconds, which are "ready" (name, form, points), which
        are "broken", with the reason, and which were "late", that is not done within `seconds`.
    """
    leave_configurations_open()
    wanted = [
        (rival, form, points)
        for rival in some
        if rival.compiled
        for form, counts in sizes.items()
        for points in counts
        if rival.wants(form, points)
    ]
    begin = time.monotonic()

    def one(work: tuple[Rival, str, int]) -> str | None:
        rival, form, points = work
        command = [sys.executable, "-m", "bench.gpu_compile", "--rival", rival.name]
        command += ["--form", form, "--points", str(points), "--device", device.type]
        environment = os.environ | {"TORCHINDUCTOR_COMPILE_THREADS": THREADS}
        return run_lines(command, environment, seconds)[1]

    record: dict[str, Any] = {"rows": len(wanted)}
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        found = pool.map(one, wanted)
        yield record
        reasons = list(found)
    record["seconds"] = time.monotonic() - begin
    places = [(rival.name, form, points) for rival, form, points in wanted]
    outcome = dict(zip(places, reasons, strict=True))
    record["ready"] = [place for place, reason in outcome.items() if reason is None]
    record["late"] = [place for place, reason in outcome.items() if reason == NO_TIME]
    record["broken"] = {
        place: reason for place, reason in outcome.items() if reason not in (None, NO_TIME)
    }


def leave_configurations_open() -> None:
    """The launch configurations that this process finds the fastest are not kept on the disk."""
    from torch._inductor import config

    config.autotune_local_cache = False


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    every = {rival.name: rival for rival in (*QUICK_RIVALS, *OTHER_RIVALS, FUNCTIONAL)}
    parser.add_argument("--rival", choices=every, required=True)
    parser.add_argument("--form", choices=["strong", "mixed"], required=True)
    parser.add_argument("--points", type=int, required=True)
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    arguments = parser.parse_args()
    leave_configurations_open()
    task = make_task(arguments.form, arguments.points).to(torch.device(arguments.device))
    every[arguments.rival].make(task)()
    if arguments.device == "cuda":
        torch.cuda.synchronize()


if __name__ == "__main__":
    main()
