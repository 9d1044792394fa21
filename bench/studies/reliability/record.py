"""The record of a gate: what was tried and how it ended, as JSON.

Every file of results/ is one record. The page "How it is tested" is made from these files alone.
"""

from __future__ import annotations

import contextlib
import json
import shlex
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from bench.machine import describe
from granpinn.results.decoding import plain

RESULTS = Path(__file__).parent / "results"
LIBRARIES = ("numpy", "h5py", "safetensors", "scipy", "pillow", "xarray", "pyvista")
KEPT = 200  # failures that a record lists; all of them are counted


@dataclass
class Record:
    """What a gate has shown.

    Attributes:
        gate: its name, such as "F-2".
        tried: number of inputs.
        outcomes: outcome -> number of inputs that ended so; they add up to `tried`.
        failures: inputs that ended as they must not, each with what is needed to repeat it.
        seconds: time of the whole run.
        command: repeats the run.
        details: further numbers of this gate, such as the outcomes for each format.
    """

    gate: str
    command: str = ""
    seconds: float = 0.0
    tried: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    failures: list[dict[str, Any]] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)

    def add(
        self, outcome: str, failure: Mapping[str, Any] | None = None, *, count: int = 1
    ) -> None:
        """Count inputs; `failure` says how to repeat one that ended as it must not."""
        self.tried += count
        self.outcomes[outcome] += count
        if failure is not None:
            self.failures.append(dict(failure))

    def write(self, path: Path) -> None:
        """Write the record as JSON, with the date, the versions and the processor."""
        machine = describe()
        versions = {name: machine[name] for name in ("granpinn", "python", "torch", "compiler")}
        whole = {
            "gate": self.gate,
            "date": time.strftime("%Y-%m-%d"),
            "versions": versions | {name: _version(name) for name in LIBRARIES},
            "device": f"{machine['processor']}, {machine['cores']} cores",
            "command": self.command,
            "seconds": round(self.seconds, 1),
            "tried": self.tried,
            "outcomes": dict(sorted(self.outcomes.items())),
            "failed": len(self.failures),
            "failures": self.failures[:KEPT],
            "details": self.details,
        }
        text = json.dumps(plain(whole), indent=1, allow_nan=False)
        path.write_text(text + "\n", encoding="utf-8")


@contextlib.contextmanager
def recorded(gate: str, module: str, out: Path | None) -> Iterator[Record]:
    """A record that is timed, written and printed at the end of the block."""
    record, begin = Record(gate, command_of(module)), time.monotonic()
    yield record
    record.seconds = time.monotonic() - begin
    if out is not None:
        record.write(out)
    print(f"{out}: {record.tried} tried, {dict(record.outcomes)}, {len(record.failures)} failed")


def read(path: Path) -> dict[str, Any]:
    """A record from its file.

    Raises:
        ValueError: the outcomes do not add up to the number of inputs.
    """
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    if sum(found["outcomes"].values()) != found["tried"]:
        raise ValueError(f"{path}: the outcomes must add up to {found['tried']} inputs")
    return found


def command_of(module: str, argv: Sequence[str] | None = None) -> str:
    """The command line that repeats a run of a module."""
    return shlex.join(["python", "-m", module, *(sys.argv[1:] if argv is None else argv)])


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
