"""Valid files of every format, and the commands that read them.

Measurements are forms of tests/importers/forms.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from granpinn.commands import train
from granpinn.data import Flow, write_flow
from tests.flows import make_flow, scattered
from tests.importers.forms import FAMILIES

TRAINING = (
    *("--steps", "2", "--network.widths", "6", "--batch.interior", "8", "--batch.surface", "4"),
    *("--log-every", "1", "--device", "cpu"),
)

SMALL = make_flow(frames=6, rows=10, columns=8)

Files = dict[str, bytes]  # path in the folder of a run -> content


class Sample(NamedTuple):
    """The valid files of a format.

    Attributes:
        files: all of them.
        commands: the commands that read them, with their arguments in the folder of the files.
        damaged: those of the files that mutants damage.
    """

    files: Files
    commands: dict[str, tuple[str, ...]]
    damaged: list[str]


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    """A folder `in` of a new working directory."""
    with tempfile.TemporaryDirectory() as made, contextlib.chdir(made):
        place = Path("in")
        place.mkdir()
        yield place


def read_all(folder: Path) -> Files:
    """All files below a folder."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def write_all(files: Files, folder: Path) -> None:
    """Write files below a folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def _sample(commands: dict[str, tuple[str, ...]], *only: str) -> Sample:
    """The files of the working directory; `only`: patterns of those that are damaged."""
    files = read_all(Path())
    names = [name for name in files if any(fnmatch(name, pattern) for pattern in only)]
    return Sample(files, commands, names)


def _convert(paths: Any, settings: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    words = map(str, paths if isinstance(paths, list) else [paths])
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
    return {"convert": (*words, "--out", "out.h5", *flags)}


def form(family: str, only: str = "*", **choices: Any) -> Sample:
    """A form of a measurement, which `convert` reads.

    Args:
        family: a key of FAMILIES.
        only: pattern of the files that are damaged.
        choices: those of the family that are not the usual ones.
    """
    with _folder() as place:
        given = FAMILIES[family].written(place, **choices)
        assert given is not None
        read: Any = given.read
        paths = read.args[0]
        if isinstance(paths, dict):  # arrays in memory, beside a file
            np.savez(place / "vectors.npz", **paths)
            paths = place / "vectors.npz"
        return _sample(_convert(paths, read.keywords), only)


def flow_file(content: Flow) -> Sample:
    """A flow file."""
    with _folder() as place:
        write_flow(content, place / "flow.h5")
        path = "in/flow.h5"
        training = (path, "--out", "run", *TRAINING)
        return _sample({"inspect": (path, "--json"), "train": training}, "*")


def run() -> Sample:
    """A run folder without its page, its images and its network."""
    with _folder() as place:
        write_flow(SMALL, place / "flow.h5")
        assert train.main(["in/flow.h5", "--out", "run", *TRAINING]) == 0
        gone = [*Path().rglob("*.png"), *Path().rglob("*.safetensors"), *Path().rglob("*.html")]
        for path in [place / "flow.h5", *gone]:
            path.unlink()
        files = "run/results.json", "run/fields.h5", "run/history.csv"
        return _sample({"report": ("run",)}, *files)


FORMATS: dict[str, Callable[[], Sample]] = {
    "flow": lambda: flow_file(SMALL),
    "particles": lambda: flow_file(scattered(SMALL)),
    "run": run,
    "pivlab": lambda: form("PIVlab text"),
    "openpiv": lambda: form("OpenPIV text"),
    "davis": lambda: form("DaVis text"),
    "basilisk": lambda: form("Basilisk"),
    "tracks": lambda: form("linked tracks"),
    "tracks-velocities": lambda: form("tracks with velocities"),
    "mat5": lambda: form("PIVlab MATLAB"),
    "mat7.3": lambda: form("PIVlab MATLAB", version="7.3"),
    "npz": lambda: form("arrays on a grid", holder="npz"),
    "mask": lambda: form("--mask", "*.png"),
    "surface": lambda: form("--surface", "*.csv"),
    "walls": lambda: form("--walls", "*.csv"),
    "times": lambda: form("--times", "*.txt"),
}
