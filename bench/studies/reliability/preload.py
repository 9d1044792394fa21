"""Builds a small C library and starts Python with it in front of the others."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SETTINGS = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "CUDA_VISIBLE_DEVICES": ""}


def built(source: Path, folder: Path) -> Path | None:
    """The library of a C file, in `folder`; None without a compiler."""
    library = folder / f"{source.stem}.so"
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
    try:
        done = subprocess.run(command, check=False)
    except FileNotFoundError:
        return None
    return library if done.returncode == 0 else None


def start(
    module: str, words: Sequence[str], library: Path | None, rows: Path
) -> subprocess.Popen[bytes]:
    """A module as a process; what it prints goes to the end of `rows`."""
    environment = os.environ | SETTINGS
    if library is not None:
        environment["LD_PRELOAD"] = str(library)
    command = [sys.executable, "-m", module, *words]
    with rows.open("a") as stream:
        return subprocess.Popen(command, env=environment, stdout=stream)
