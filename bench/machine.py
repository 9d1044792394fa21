"""The machine and the versions behind a measurement."""

from __future__ import annotations

import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

import torch

import granpinn


@cache
def describe() -> dict[str, Any]:
    """Processor, cores that this process may use, versions, and the kernels in use."""
    from granpinn import _C

    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(),
        "python": platform.python_version(),
        "torch": torch.__version__,
        "granpinn": granpinn.__version__,
        "kernels": _C.cpu_capability(),
        "compiler": _C.build_info()["compiler"],
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()
