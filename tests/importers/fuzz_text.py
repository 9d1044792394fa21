"""Converts damaged copies of every text format: `python -m tests.importers.fuzz_text SEED COUNT`.

One process for each format, with limits of memory and time. Prints a line of JSON for each format:
the number of flows and refusals, and every other outcome with the name of its damage.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granpinn.data import FlowFileError, FlowFileWarning
from granpinn.data.memory import _address_space
from granpinn.data.rules import check_flow
from granpinn.importers import DataFileError, read
from tests.importers import scene
from tests.importers.mutants import mutants
from tests.importers.test_other_piv import davis, insight, openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk
from tests.importers.test_tracks import motion, write_csv

SECONDS = 10.0  # a mutant
MEMORY = 2**30  # more than the process has after its imports
MATERIAL = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}
CAMERA = {"scale": "0.5 mm/px", "frame_rate": "500 Hz"}
PIXELS = {"length_unit": "px", "velocity_unit": "px/frame"}


@dataclass(frozen=True)
class Case:
    """A file that is damaged, what stays whole beside it, and the settings of the conversion."""

    name: str
    write: Callable[[Path], Any]
    settings: dict[str, Any]
    other: Callable[[Path], Any] | None = None
    setting: str = ""  # that names the damaged file; then `other` is the data


def _tracks(path: Path) -> Path:
    return write_csv(path, motion(0.05, tracks=12))


def _velocities(path: Path) -> Path:
    columns = motion(0.05, tracks=12)
    named = {"t [ms]": 2 * columns["frame"], "x [px]": columns["x"], "y [px]": columns["y"]}
    return write_csv(path, named | {"u [px/s]": columns["x"], "v": columns["y"]})


def _line(path: Path) -> Path:
    rows = [f"{k},{x},{x}" for k in range(6) for x in range(24, 72, 8)]
    return scene.write_lines(path, ["t [ms],x [px],y [px]", *rows])


def _walls(path: Path) -> Path:
    rows = ["16,80,0,1,0", "96,80,0,1,0", "nan,nan,nan,nan,nan", "16,16,1,0,0", "16,80,1,0,0"]
    return scene.write_lines(path, ["x [px],y [px],slip,u,v", *rows])


def _times(path: Path) -> Path:
    return scene.write_lines(path, ["t [ms]", "1", "3"])


def _two(path: Path) -> None:
    export(path / "b1.txt", 1)
    export(path / "b2.txt", 2)


CASES = {
    "pivlab": Case("a.txt", export, CAMERA, lambda p: export(p / "b1.txt", 1)),
    "pivlab bare": Case(
        "a.txt",
        lambda p: export(p, info=False, header=False, delimiter="\t"),
        CAMERA | PIXELS,
        lambda p: export(p / "b1.txt", 1, info=False, header=False),
    ),
    "openpiv": Case("a.txt", openpiv, CAMERA | PIXELS, lambda p: openpiv(p / "b1.txt", 1)),
    "insight": Case("a.vec", insight, CAMERA, lambda p: insight(p / "b1.vec", 1)),
    "davis": Case("a.txt", davis, CAMERA, lambda p: davis(p / "b1.txt", 1)),
    "basilisk": Case(
        "a-0.1.txt",
        basilisk,
        {"dimensionless": True, "times": "name", "grain_diameter": "0.1"},
        lambda p: basilisk(p / "a-0.2.txt", 1),
    ),
    "tracks": Case("a.csv", _tracks, CAMERA | PIXELS | {"flip_y": "no"}),
    "velocities": Case("a.csv", _velocities, CAMERA | {"velocity_unit": "px/s", "flip_y": "no"}),
    "times": Case("t.txt", _times, CAMERA | {"pulse_delay": "1 ms"}, _two, "times"),
    "surface": Case("s.csv", _line, CAMERA, _two, "surface"),
    "walls": Case("w.csv", _walls, CAMERA, _two, "walls"),
}


class TooSlow(BaseException):
    """A conversion has taken more than `SECONDS`."""


def _stop(*_: Any) -> None:
    raise TooSlow


def outcome(case: Case, folder: Path, content: bytes) -> str:
    """What the conversion of one damaged file gives: "flow", "refused", or something wrong."""
    (folder / case.name).write_bytes(content)
    files = sorted(p for p in folder.iterdir() if not case.setting or p.name != case.name)
    given = {case.setting: str(folder / case.name)} if case.setting else {}
    material = {} if "dimensionless" in case.settings else MATERIAL
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", FlowFileWarning)
            check_flow(read(files, **material, **case.settings, **given))
        return "flow"
    except (DataFileError, FlowFileError) as error:
        text = str(error)
        return "refused" if text.isprintable() and len(text) < 1000 else f"message: {text!r}"
    except TooSlow:
        return "too slow " + traceback.format_exc()[-600:]
    except BaseException:
        return traceback.format_exc()[-1200:]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def attack(name: str, seed: int, count: int) -> dict[str, Any]:
    """The outcomes of all damaged copies of one format."""
    case = CASES[name]
    found: dict[str, Any] = {"format": name, "flow": 0, "refused": 0, "wrong": {}}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        case.write(folder / case.name)
        if case.other:
            case.other(folder)
        whole = (folder / case.name).read_bytes()
        assert outcome(case, folder, whole) == "flow", outcome(case, folder, whole)
        for damage, content in mutants(whole, seed, count):
            result = outcome(case, folder, content)
            if result in ("flow", "refused"):
                found[result] += 1
            else:
                found["wrong"][damage] = result
    return found


def main(seed: int, count: int) -> None:
    signal.signal(signal.SIGALRM, _stop)
    for name in CASES:
        child = os.fork()
        if child == 0:
            limit = _address_space() + MEMORY
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            print(json.dumps(attack(name, seed, count)), flush=True)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if status:
            print(
                json.dumps({"format": name, "wrong": {"process": f"status {status}"}}), flush=True
            )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
