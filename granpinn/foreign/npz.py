"""Arrays of an .npz archive, by NumPy, which unpickles nothing unless it is told to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError

LIBRARY = "numpy"
MAX_MEMBERS = 64


def read(path: Path, answer: Answer) -> dict[str, Any]:
    """The arrays by name: numbers as arrays, text as a list."""
    with np.load(path) as archive:
        names = archive.files
        if len(names) > MAX_MEMBERS or len(set(names)) < len(names):
            raise UnsafeFileError(
                f"it must hold at most {MAX_MEMBERS} arrays of different names, got {len(names)}: "
                "write plain arrays with numpy.savez"
            )
        arrays = ((name, archive[name]) for name in names)
        return {n: a.tolist() if a.dtype.kind == "U" else answer.keep(a) for n, a in arrays}
