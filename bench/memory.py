"""Peak memory of one step beyond its inputs, measured in a process of its own.

python -m bench.memory --form strong --step fused --points 4096
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import torch

from bench.steps import STEPS, make_task

STATUS = Path("/proc/self/status")


def _kilobytes(name: str) -> int:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1])


def peak(form: str, step: str, points: int) -> float:
    """Megabytes that a step adds to the resident memory after its inputs are loaded (Linux)."""
    warm_up = STEPS[step](make_task(form, 32))
    warm_up()
    advance = STEPS[step](make_task(form, points))
    Path("/proc/self/clear_refs").write_text("5")  # resets the high-water mark
    before = _kilobytes("VmRSS")
    advance()
    return (_kilobytes("VmHWM") - before) / 1024


def peak_in_subprocess(form: str, step: str, points: int) -> float:
    command = [sys.executable, "-m", "bench.memory", "--form", form, "--step", step]
    command += ["--points", str(points)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return float(json.loads(output)["megabytes"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--form", choices=["strong", "mixed"], required=True)
    parser.add_argument("--step", choices=list(STEPS), required=True)
    parser.add_argument("--points", type=int, required=True)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    print(json.dumps({"megabytes": round(peak(**vars(arguments)), 2)}))
