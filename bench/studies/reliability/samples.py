"""Valid files of every format, and the command lines that read them."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.studies.reliability import writers
from bench.studies.reliability.writers import NO_PRESSURE, TRAINING

CAMERA = ("--scale", "0.5 mm/px", "--frame-rate", "500 Hz")
MATERIAL = ("--grain-diameter", "2 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")
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

    write: Callable[[Path], object]
    commands: dict[str, tuple[str, ...]]
    needs: tuple[str, ...] = ()
    text: bool = False
    only: tuple[str, ...] = ()

    def missing(self) -> list[str]:
        """The modules that cannot be imported."""
        return [name for name in self.needs if not _importable(name)]

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


def _importable(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


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


def converted(sources: Sequence[str], *settings: str) -> dict[str, tuple[str, ...]]:
    """The command line of a conversion."""
    return {"convert": (*sources, "--out", "out.h5", *settings)}


_TEXTS = ("a0.txt", "a1.txt", "a2.txt")
_OPTIONS = {
    "inspect": ("flow.h5", "--json"),
    "train": ("flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE),
    "train-pressure": ("flow.h5", "--out", "run", *TRAINING, *PRESSURE),
    "convert": ("flow.h5", "--out", "out.h5"),
}
FORMATS: dict[str, Format] = {
    "flow": Format(writers.flow, _OPTIONS),
    "particles": Format(writers.particles, _OPTIONS),
    "run": Format(
        writers.run,
        {"report": ("run",), "report-paraview": ("run", "--paraview")},
        only=("run/results.json", "run/fields.h5", "run/history.csv"),
    ),
    "pivlab": Format(
        writers.frames("a{}.txt", writers.by_name("test_pivlab_text", "export")),
        converted(_TEXTS, *CAMERA, *MATERIAL),
        text=True,
    ),
    "openpiv": Format(
        writers.frames("a{}.txt", writers.by_name("test_other_piv", "openpiv")),
        converted(_TEXTS, *CAMERA, *MATERIAL, *PIXELS),
        text=True,
    ),
    "insight": Format(
        writers.frames("a{}.vec", writers.by_name("test_other_piv", "insight")),
        converted(("a0.vec", "a1.vec", "a2.vec"), *CAMERA, *MATERIAL),
        text=True,
    ),
    "davis": Format(
        writers.frames("a{}.txt", writers.by_name("test_other_piv", "davis")),
        converted(_TEXTS, "--frame-rate", "9 Hz", *MATERIAL),
        text=True,
    ),
    "basilisk": Format(
        writers.frames("a-{}.txt", writers.by_name("test_simulation_files", "basilisk")),
        converted(("a-0.txt", "a-1.txt", "a-2.txt"), *PLAIN, "--times", "name"),
        text=True,
    ),
    "tracks": Format(
        writers.tracks,
        converted(("a.csv",), *CAMERA, *MATERIAL, *PIXELS, "--flip-y", "yes"),
        text=True,
    ),
    "tracks-hdf5": Format(
        writers.tracks_hdf5,
        converted(("a.h5",), *CAMERA, *MATERIAL, *PIXELS, "--flip-y", "yes"),
        needs=("pandas", "tables"),
    ),
    "mat5": Format(
        writers.mat("version_5", "all_frames"), converted(("a.mat",), *CAMERA, *MATERIAL)
    ),
    "mat5-session": Format(
        writers.mat("version_5", "session"), converted(("a.mat",), *CAMERA, *MATERIAL)
    ),
    "mat7.3": Format(
        writers.mat("version_73", "all_frames"), converted(("a.mat",), *CAMERA, *MATERIAL)
    ),
    "mat7.3-session": Format(
        writers.mat("version_73", "session"), converted(("a.mat",), *CAMERA, *MATERIAL)
    ),
    "npz": Format(writers.npz, converted(("a.npz",), *CAMERA, *MATERIAL)),
    "netcdf": Format(
        writers.netcdf,
        converted(("a.nc",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "h5netcdf"),
    ),
    "zarr2": Format(
        writers.zarr(2),
        converted(("a.zarr",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "zarr"),
    ),
    "zarr3": Format(
        writers.zarr(3),
        converted(("a.zarr",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "zarr"),
    ),
    "vti": Format(
        writers.vtk,
        converted(("a0.vti", "a1.vti"), *PLAIN),
        needs=("pyvista",),
        only=("a0.vti", "a1.vti"),
    ),
    "vtk": Format(
        writers.vtk,
        converted(("b0.vtk", "b1.vtk"), *PLAIN),
        needs=("pyvista",),
        text=True,
        only=("b0.vtk", "b1.vtk"),
    ),
    "foam": Format(writers.foam, converted(("case",), *PLAIN), needs=("pyvista",), text=True),
    "vc7": Format(
        writers.vc7,
        converted(("B0.vc7", "B1.vc7", "B2.vc7"), *CAMERA, *MATERIAL),
        needs=("lvpyio",),
    ),
    "mask": Format(
        writers.mask,
        converted(("a.npz",), "--mask", "m*.png", *CAMERA, *MATERIAL),
        only=("m0.png", "m1.png"),
    ),
    "surface": Format(
        writers.line,
        converted(("a.npz",), "--surface", "line.csv", *CAMERA, *MATERIAL),
        text=True,
        only=("line.csv",),
    ),
    "times": Format(
        writers.line,
        converted(("a.npz",), "--times", "times.txt", "--time-unit", "frame", *CAMERA, *MATERIAL),
        text=True,
        only=("times.txt",),
    ),
}
