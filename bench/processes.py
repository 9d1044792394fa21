"""Measurements in processes of their own, which print lines of JSON."""

from __future__ import annotations

import json
import subprocess
from typing import Any


def run_lines(
    command: list[str], environment: dict[str, str] | None, seconds: float
) -> tuple[list[dict[str, Any]], str | None]:
    """The lines of JSON that a command prints, and its error if it fails."""
    reason = None
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=seconds, check=False
        )
        out = done.stdout
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["no message"])[-1][:300]
    except subprocess.TimeoutExpired as error:
        out = error.stdout.decode() if isinstance(error.stdout, bytes) else error.stdout or ""
        reason = "no time left"
    lines = [line for line in out.splitlines() if line.startswith("{") and line.endswith("}")]
    return [json.loads(line) for line in lines], reason
