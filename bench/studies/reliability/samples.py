"""Valid files of every format, and the command lines that read them."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bench.studies.reliability import writers
from bench.studies.reliability.writers import NO_PRESSURE, TRAINING, Writer, frames
from tests.importers.test_other_piv import davis, insight, openpiv
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk

CAMERA = ("--scale", "0.5 mm/px", "--frame-rate", "500 Hz")
MATERIAL = ("--grain-diameter", "2 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")
LAB, FLIP = (*CAMERA, *MATERIAL), ("--flip-y", "yes")
PLAIN = ("--dimensionless", "--grain-diameter", "0.5")
PIXELS = ("--length-unit", "px", "--velocity-unit", "px/frame")
PRESSURE = ("--simulated_pressure.frames", "1", "--simulated_pressure.cells", "32")

Files = dict[str, bytes]  # path in the folder of a run -> content


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes:
        write: writes the valid files to a folder.
        commands: command -> its arguments in that folder.
        needs: modules without which the format is left out.
        text: whether its files are text.
        only: of the files, those that are damaged; all if empty.
    """

    write: Writer
    commands: dict[str, tuple[str, ...]]
    needs: tuple[str, ...] = ()
    text: bool = False
    only: tuple[str, ...] = ()

    def missing(self) -> list[str]:
        """The modules that are not installed."""
        return [name for name in self.needs if find_spec(name) is None]

    def files(self) -> Files:
        """The valid files."""
        with tempfile.TemporaryDirectory() as folder:
            before = Path.cwd()
            os.chdir(folder)
            try:
                printed = io.StringIO()
                with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(printed):
                    self.write(Path(folder))
            finally:
                os.chdir(before)
            return read_all(Path(folder))


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


def by_convert(write: Writer, words: str, *settings: str, **others: Any) -> Format:
    """A format of a measurement that `convert` reads.

    Args:
        words: the paths on the command line.
        settings: of the conversion.
        others: further fields of the format.
    """
    command = (*words.split(), "--out", "out.h5", *settings)
    return Format(write, {"convert": command}, **others)


_TEXTS = "a0.txt a1.txt a2.txt"
_OPTIONS = {
    "inspect": ("flow.h5", "--json"),
    "train": ("flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE),
    "train-pressure": ("flow.h5", "--out", "run", *TRAINING, *PRESSURE),
}
_REPORTS = {"report": ("run",), "report-paraview": ("run", "--paraview")}
_OF_RUN = ("run/results.json", "run/fields.h5", "run/history.csv")
_BASILISK = "a-0.txt a-1.txt a-2.txt"
_TIMES = ("--times", "times.txt", "--scale", "0.5 mm/px", "--pulse-delay", "2 ms", *MATERIAL)
FORMATS: dict[str, Format] = {
    "flow": Format(writers.flow, _OPTIONS),
    "particles": Format(writers.particles, _OPTIONS),
    "run": Format(writers.run, _REPORTS, only=_OF_RUN),
    "pivlab": by_convert(frames("a{}.txt", export), _TEXTS, *LAB, text=True),
    "openpiv": by_convert(frames("a{}.txt", openpiv), _TEXTS, *LAB, *PIXELS, text=True),
    "insight": by_convert(frames("a{}.vec", insight), "a0.vec a1.vec a2.vec", *LAB, text=True),
    "davis": by_convert(
        frames("a{}.txt", davis), _TEXTS, "--frame-rate", "9 Hz", *MATERIAL, text=True
    ),
    "basilisk": by_convert(
        frames("a-{}.txt", basilisk), _BASILISK, *PLAIN, "--times", "name", text=True
    ),
    "tracks": by_convert(writers.tracks, "a.csv", *LAB, *PIXELS, *FLIP, text=True),
    "mat5": by_convert(writers.mat("version_5", "all_frames"), "a.mat", *LAB),
    "mat5-session": by_convert(writers.mat("version_5", "session"), "a.mat", *LAB),
    "mat7.3": by_convert(writers.mat("version_73", "all_frames"), "a.mat", *LAB),
    "mat7.3-session": by_convert(writers.mat("version_73", "session"), "a.mat", *LAB),
    "npz": by_convert(writers.npz, "a.npz", *LAB),
    "netcdf": by_convert(writers.netcdf, "a.nc", *LAB, *FLIP, needs=("xarray", "h5netcdf")),
    "vti": by_convert(
        writers.vtk, "a0.vti a1.vti", *PLAIN, needs=("pyvista",), only=("a0.vti", "a1.vti")
    ),
    "vtk": by_convert(
        writers.vtk,
        "b0.vtk b1.vtk",
        *PLAIN,
        needs=("pyvista",),
        text=True,
        only=("b0.vtk", "b1.vtk"),
    ),
    "foam": by_convert(writers.foam, "case", *PLAIN, needs=("pyvista",), text=True),
    "vc7": by_convert(writers.vc7, "B0.vc7 B1.vc7 B2.vc7", *LAB, needs=("lvpyio",)),
    "mask": by_convert(writers.mask, "a.npz", "--mask", "m*.png", *LAB, only=("m0.png", "m1.png")),
    "surface": by_convert(
        writers.line, "a.npz", "--surface", "line.csv", *LAB, text=True, only=("line.csv",)
    ),
    "times": by_convert(writers.line, "a.npz", *_TIMES, text=True, only=("times.txt",)),
}
