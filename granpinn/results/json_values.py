"""Strict JSON: values of Python as JSON values, and JSON text that is read."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from granpinn.regular import read_text


def read_json(path: Path) -> Any:
    """The content of a regular file with strict JSON.

    Raises:
        UnsafeFileError: as `read_text`.
        ValueError: the text is no strict JSON.
    """
    return parsed(read_text(path))


def parsed(text: str | bytes) -> Any:
    """The content of strict JSON; ValueError for any other text."""
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except RecursionError as error:
        raise ValueError(str(error)) from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number, expected null")


def plain(value: Any) -> Any:
    """JSON values only: NumPy and torch scalars and arrays, paths and tuples are converted."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, os.PathLike):
        return plain(os.fspath(value))
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):  # a file name may hold bytes that are not UTF-8; JSON cannot
        return value.encode(errors="backslashreplace").decode()
    if value is None or isinstance(value, (bool, int)):
        return value
    raise TypeError(f"results.json holds plain values only, got {type(value).__name__}: {value!r}")
