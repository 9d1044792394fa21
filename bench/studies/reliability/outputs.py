"""The commands that write files, as small as they get, and what their files must be."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
from safetensors.numpy import load

from bench.studies.reliability.samples import CAMERA, FORMATS, MATERIAL, Files
from bench.studies.reliability.writers import NO_PRESSURE, TRAINING

COLLAPSE = ("--cells", "48", "--stride", "2", "--frames", "4", "--t-end", "0.2", "--threads", "1")
TRAIN = ("flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE, "--checkpoint-every", "0")
TWO = (*TRAIN, "--members", "2")
SHOWN = ("run/report.html",)


@dataclass(frozen=True)
class Case:
    """A command that writes files.

    Attributes:
        command: such as "train".
        arguments: its command line.
        inputs: the format whose valid files it reads.
        repeated: whether its files are there already, from an earlier run.
        resume: arguments that continue it after a fault; empty: the same command once more.
        timed: files that show rounded times, which are the same in two runs only by chance.
    """

    command: str
    arguments: tuple[str, ...]
    inputs: str | None = "flow"
    repeated: bool = False
    resume: tuple[str, ...] = ()
    timed: tuple[str, ...] = ()

    def files(self) -> Files:
        """The files that are there before the first run."""
        return FORMATS[self.inputs].files() if self.inputs else {}


CASES: dict[str, Case] = {
    "train": Case("train", TRAIN, resume=(*TRAIN, "--resume"), timed=SHOWN),
    "train, two members": Case("train", TWO, resume=(*TWO, "--resume"), timed=SHOWN),
    "convert": Case(
        "convert",
        ("a0.txt", "a1.txt", "a2.txt", "--out", "out.h5", *CAMERA, *MATERIAL),
        inputs="pivlab",
        repeated=True,
    ),
    "simulate": Case("simulate", (*COLLAPSE, "--out", "out.h5"), inputs=None, repeated=True),
    "simulate, figures": Case(
        "simulate",
        (*COLLAPSE, "--out", "out.h5", "--animation", "out.gif"),
        inputs=None,
    ),
    "inspect": Case("inspect", ("flow.h5", "--out", "inspection"), repeated=True),
    "report": Case("report", ("run",), inputs="run", repeated=True),
    "report, ParaView": Case("report", ("run", "--paraview"), inputs="run", repeated=True),
}


def damaged(name: str, content: bytes, folder: Path) -> bool:
    """Whether a file of ours is not whole, from its content."""
    check = CHECKS.get(Path(name).suffix)
    # Rows are appended to a history; a run that is continued cuts it where its checkpoint ends.
    if check is None or Path(name).name == "history.csv":
        return False
    try:
        return not check(content, folder)
    except (OSError, ValueError, RuntimeError, KeyError):
        return True


def _hdf5(content: bytes, folder: Path) -> bool:
    path = folder / "whole.tmp.h5"
    path.write_bytes(content)
    try:
        with h5py.File(path) as file:
            file.visititems(lambda _, node: node[()] is None if hasattr(node, "dtype") else None)
    finally:
        path.unlink()
    return True


CHECKS: dict[str, Callable[[bytes, Path], bool]] = {
    ".json": lambda content, _: json.loads(content) is not None,
    ".h5": _hdf5,
    ".nc": _hdf5,
    ".png": lambda content, _: content.startswith(b"\x89PNG") and b"IEND" in content[-16:],
    ".gif": lambda content, _: content.startswith(b"GIF8") and content.endswith(b";"),
    ".html": lambda content, _: content.rstrip().endswith(b"</html>"),
    ".csv": lambda content, _: content.endswith(b"\n"),
    ".toml": lambda content, _: content.endswith(b"\n"),
    ".safetensors": lambda content, _: bool(load(content)),
}
