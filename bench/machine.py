"""The machine and the versions behind a measurement."""

from __future__ import annotations

import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

import torch

import granpinn

MODEL = ("cpu family", "model", "stepping")  # of /proc/cpuinfo


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
    """The name, and the numbers of the model where the name alone may be that of a family."""
    found: dict[str, str] = {}
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        name, _, value = line.partition(":")
        found.setdefault(name.strip(), value.strip())
    if "model name" not in found:
        return platform.processor()
    numbers = [f"{name} {found[name]}" for name in MODEL if name in found]
    return f"{found['model name']} ({', '.join(numbers)})" if numbers else found["model name"]
