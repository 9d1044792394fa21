"""What an outcome is called, and whether a command may end so."""

from __future__ import annotations

import re
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import granpinn
from bench.studies.reliability.sandbox import PREPARATION, Outcome
from tests.data.hostile_edits import OUTSIDE

ALLOWED = {"ok", "refused", "could not go on", "input not made"}
MEMORY_FACTOR = 3  # gate F-4
LEAST_MEMORY = 48 * 2**20  # bytes: below it, modules that are imported late count more than data
BAIT = OUTSIDE  # a file beside the mutant, which no command is told to read
READER = "granpinn.foreign.program"
SYSTEM = (
    *("/proc/", "/sys/", "/usr/", "/lib", "/etc/", "/dev/null", "/dev/urandom", "/var/lib/"),
    *("/var/cache/fontconfig", "/dev/tty"),
)


def judged(found: Outcome, command: str, folder: Path, valid: Outcome | None) -> str:
    """The name of an outcome.

    Args:
        found: how the command ended.
        command: the name of the command, such as "train".
        folder: its working directory, as it is afterwards.
        valid: the run of the same command on the valid file; None for that run itself.
    """
    if found.code == PREPARATION:
        return "input not made"
    broken = found.broken
    if broken is not None and broken != "traceback":
        return broken
    if started(found, valid):
        return "process or connection started"
    if foreign(found, folder, valid):
        return "foreign file opened"
    if broken is not None:
        return broken
    if valid is not None and found.memory > MEMORY_FACTOR * max(valid.memory, LEAST_MEMORY):
        return "too much memory"
    if left_over(folder):
        return "temporary file left"
    return by_code(found, command)


def by_code(found: Outcome, command: str) -> str:
    """The name of an outcome by its exit code and its sentence."""
    if found.code == 0:
        return "ok"
    if found.code not in (1, 2):
        return f"exit code {found.code}"
    if "this is a bug of granpinn" in found.errors:
        return "bug"
    sentences = [line for line in found.errors.splitlines() if line.startswith("granpinn.")]
    lines = [line for line in found.errors.strip().splitlines() if line]
    name = f"granpinn.{command.split('-')[0]}: "
    if len(sentences) != 1 or not lines or not lines[-1].startswith(name):
        return "no single sentence"
    return "refused" if found.code == 2 else "could not go on"


def started(found: Outcome, valid: Outcome | None) -> set[str]:
    """What a command started, without what it starts for the valid file too.

    A process of ours opens the files; a pair of sockets connects it with the command.
    """
    known = {"socket.__new__"} | {line.split()[0] for line in (valid.started if valid else ())}
    foreign = {line for line in found.started if line.split()[0] not in known}
    return {line for line in foreign if READER not in line}


def foreign(found: Outcome, folder: Path, valid: Outcome | None) -> set[str]:
    """Paths that a command opened although they are none of its business."""
    inside = (str(folder), *_own_places(), *SYSTEM)
    known = valid.opened if valid is not None else set()
    opened = set()
    for path in found.opened - known:
        whole = str((folder / path).resolve()) if not path.startswith("/") else path
        if path.endswith(BAIT) or not whole.startswith(inside):
            opened.add(path)
    return opened


def _own_places() -> tuple[str, ...]:
    paths = sysconfig.get_paths()
    own = str(Path(granpinn.__file__).parents[1])
    places = (sys.prefix, sys.base_prefix, paths["stdlib"], own, *filter(None, sys.path))
    home = Path.home()
    return (*places, str(home / ".cache" / "matplotlib"), str(home / ".config" / "matplotlib"))


def left_over(folder: Path) -> list[str]:
    """Temporary files that nobody removed."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.tmp"))


def fingerprint(found: Outcome) -> str:
    """What equal failures have in common: the last place in granpinn, and the kind of the error."""
    places = re.findall(r'File ".*?(granpinn/[^"]+)", line (\d+)', found.errors)
    lines = [line for line in found.errors.strip().splitlines() if line.strip()]
    last = lines[-1][:100] if lines else ""
    kind = re.split(r"[:\s]", last)[0] if places else re.sub(r"[\d.]+", "N", last)[:60]
    return f"{kind} at {':'.join(places[-1])}" if places else kind


def described(found: Outcome, valid: Outcome) -> Mapping[str, Any]:
    """The numbers of an outcome for the record."""
    return {
        "code": found.code,
        "seconds": round(found.seconds, 2),
        "memory_MiB": round(found.memory / 2**20),
        "memory_ratio": round(found.memory / max(valid.memory, LEAST_MEMORY), 2),
        "message": found.errors.strip()[-300:],
    }
