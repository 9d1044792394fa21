"""Valid files of every format, and the command lines that read them."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CAMERA = ("--scale", "0.5 mm/px", "--frame-rate", "500 Hz")
MATERIAL = ("--grain-diameter", "2 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")
PLAIN = ("--dimensionless", "--grain-diameter", "0.5")
PIXELS = ("--length-unit", "px", "--velocity-unit", "px/frame")
TRAINING = (
    *("--steps", "2", "--network.widths", "6", "--batch.interior", "8", "--batch.surface", "4"),
    *("--log-every", "1", "--device", "cpu"),
)
NO_PRESSURE = ("--simulated_pressure.frames", "0")
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
        """The modules that are not installed."""
        return [name for name in self.needs if importlib.util.find_spec(name) is None]

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


def converted(sources: Sequence[str], *settings: str) -> dict[str, tuple[str, ...]]:
    """The command line of a conversion."""
    return {"convert": (*sources, "--out", "out.h5", *settings)}


def _flow(folder: Path, **changes: Any) -> None:
    from granpinn.data import write_flow
    from tests.flows import make_flow

    write_flow(make_flow(frames=6, rows=10, columns=8, **changes), folder / "flow.h5")


def _particles(folder: Path) -> None:
    import numpy as np

    from granpinn.data import Particles, Surface, particle_flow, write_flow
    from tests.flows import make_flow

    flow = make_flow(frames=6, rows=10, columns=8)
    frame, row, column = flow.valid.nonzero()
    values = {name: getattr(flow, name)[flow.valid].astype(float) for name in "uv"}
    points = Particles(t=flow.t[frame], y=flow.y[row], x=flow.x[column], **values)
    kept = ("gravity", "density", "grain_diameter", "length_unit", "time_unit")
    others = {name: getattr(flow, name) for name in kept}
    line = flow.surface
    assert line is not None
    low, high = ({n: f(getattr(points, n)) for n in "yx"} for f in (np.min, np.max))
    margin = {n: 0.2 * (high[n] - low[n]) for n in "yx"}  # the grid of a report is smaller
    inside = np.ones(line.t.size, bool)
    for n in "yx":
        at = getattr(line, n)
        inside &= (at > low[n] + margin[n]) & (at < high[n] - margin[n])
    surface = Surface(t=line.t[inside], x=line.x[inside], y=line.y[inside])
    write_flow(particle_flow(points, surface=surface, **others), folder / "flow.h5")


def _run(folder: Path) -> None:
    from granpinn.train import main

    _flow(folder)
    assert main(["flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE]) == 0
    (folder / "run" / "report.html").unlink()
    (folder / "flow.h5").unlink()
    for path in [*folder.rglob("*.png"), *folder.rglob("*.safetensors")]:
        path.unlink()


def _frames(name: str, write: Callable[[Path, int], object]) -> Callable[[Path], object]:
    """Three frames, one file each."""
    return lambda folder: [write(folder / name.format(k), k) for k in range(3)]


def _by_name(module: str, function: str) -> Callable[..., Any]:
    """A writer of tests/importers, imported when it is called."""
    return lambda *args: getattr(importlib.import_module(f"tests.importers.{module}"), function)(
        *args
    )


def _mat(version: str, content: str) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        from tests.importers import test_pivlab_mat as mat

        getattr(mat, version)(folder / "a.mat", getattr(mat, content)())

    return write


def _npz(folder: Path) -> None:
    import numpy as np

    from tests.importers.test_simulation_files import ARRAYS

    np.savez(folder / "a.npz", **ARRAYS)


def _netcdf(folder: Path) -> None:
    from tests.importers.test_simulation_files import dataset

    dataset().to_netcdf(folder / "a.nc", engine="h5netcdf")


def _zarr(version: int) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        import warnings

        from tests.importers.test_simulation_files import dataset

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            dataset().to_zarr(folder / "a.zarr", zarr_format=version)

    return write


def _tracks(folder: Path) -> None:
    from tests.importers.test_tracks import motion, write_csv

    write_csv(folder / "a.csv", motion(tracks=6))


def _tracks_hdf5(folder: Path) -> None:
    import warnings

    import pandas as pd

    from tests.importers.test_tracks import motion

    table = pd.DataFrame(motion(0.05, tracks=6)).astype({"frame": int, "particle": int})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pd.HDFStore(folder / "a.h5") as store:
            store.append("FrameData", table, data_columns=["frame"])


def _vtk(folder: Path) -> None:
    import numpy as np
    import pyvista

    from tests.importers import scene

    for k in range(2):
        grid = pyvista.ImageData(dimensions=(10, 8, 2), spacing=(8, 8, 1), origin=(12, 20, 0))
        u, v = (part[k] for part in scene.velocity())
        grid.cell_data["U"] = np.stack([u.ravel(), v.ravel(), 0 * u.ravel()], axis=1)
        grid.cell_data["alpha.grains"] = np.where(scene.codes()[k] == 0, 0.0, 1.0).ravel()
        grid.field_data["TimeValue"] = [0.25 * (k + 1)]
        grid.save(folder / f"a{k}.vti")
        grid.cast_to_rectilinear_grid().save(folder / f"b{k}.vtk", binary=False)


def _foam(folder: Path) -> None:
    from tests.importers.test_meshes import foam_case

    (folder / "case").mkdir()
    foam_case(folder / "case")
    (folder / "case" / "case.foam").write_bytes(b"")


def _vc7(folder: Path) -> None:
    import lvpyio
    import numpy as np

    from tests.importers import scene

    for k in range(3):
        frame = np.zeros((scene.ROWS, scene.COLUMNS), dtype=lvpyio.vec2c)
        frame["u"], frame["v"] = (part[k] for part in scene.velocity())
        masked = np.ma.array(frame, mask=scene.codes()[k] == 0)
        lvpyio.write_buffer(lvpyio.arrays_to_buffer([masked]), str(folder / f"B{k}.vc7"))


def _mask(folder: Path) -> None:
    import numpy as np

    from tests.importers import test_surface as surface

    arrays = surface.in_pixels()
    np.savez(folder / "a.npz", **arrays)
    for k in range(3):
        bright = np.kron(surface.C[k, ::-1] > 0.5, np.ones((10, 10))) > 0
        surface.write_image(folder / f"m{k}.png", bright)


def _line(folder: Path) -> None:
    from tests.importers import test_surface as surface

    _mask(folder)
    (folder / "times.txt").write_text("t [ms]\n10\n25\n60\n")
    surface.line_file(folder / "line.csv", "frame,x,y", factor=10.0)


_TEXTS = ("a0.txt", "a1.txt", "a2.txt")
_OPTIONS = {
    "inspect": ("flow.h5", "--json"),
    "train": ("flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE),
    "train-pressure": ("flow.h5", "--out", "run", *TRAINING, *PRESSURE),
    "convert": ("flow.h5", "--out", "out.h5"),
}
FORMATS: dict[str, Format] = {
    "flow": Format(_flow, _OPTIONS),
    "particles": Format(_particles, _OPTIONS),
    "run": Format(
        _run,
        {"report": ("run",), "report-paraview": ("run", "--paraview")},
        only=("run/results.json", "run/fields.h5", "run/history.csv"),
    ),
    "pivlab": Format(
        _frames("a{}.txt", _by_name("test_pivlab_text", "export")),
        converted(_TEXTS, *CAMERA, *MATERIAL),
        text=True,
    ),
    "openpiv": Format(
        _frames("a{}.txt", _by_name("test_other_piv", "openpiv")),
        converted(_TEXTS, *CAMERA, *MATERIAL, *PIXELS),
        text=True,
    ),
    "insight": Format(
        _frames("a{}.vec", _by_name("test_other_piv", "insight")),
        converted(("a0.vec", "a1.vec", "a2.vec"), *CAMERA, *MATERIAL),
        text=True,
    ),
    "davis": Format(
        _frames("a{}.txt", _by_name("test_other_piv", "davis")),
        converted(_TEXTS, "--frame-rate", "9 Hz", *MATERIAL),
        text=True,
    ),
    "basilisk": Format(
        _frames("a-{}.txt", _by_name("test_simulation_files", "basilisk")),
        converted(("a-0.txt", "a-1.txt", "a-2.txt"), *PLAIN, "--times", "name"),
        text=True,
    ),
    "tracks": Format(
        _tracks, converted(("a.csv",), *CAMERA, *MATERIAL, *PIXELS, "--flip-y", "yes"), text=True
    ),
    "tracks-hdf5": Format(
        _tracks_hdf5,
        converted(("a.h5",), *CAMERA, *MATERIAL, *PIXELS, "--flip-y", "yes"),
        needs=("pandas", "tables"),
    ),
    "mat5": Format(_mat("version_5", "all_frames"), converted(("a.mat",), *CAMERA, *MATERIAL)),
    "mat5-session": Format(_mat("version_5", "session"), converted(("a.mat",), *CAMERA, *MATERIAL)),
    "mat7.3": Format(_mat("version_73", "all_frames"), converted(("a.mat",), *CAMERA, *MATERIAL)),
    "mat7.3-session": Format(
        _mat("version_73", "session"), converted(("a.mat",), *CAMERA, *MATERIAL)
    ),
    "npz": Format(_npz, converted(("a.npz",), *CAMERA, *MATERIAL)),
    "netcdf": Format(
        _netcdf,
        converted(("a.nc",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "h5netcdf"),
    ),
    "zarr2": Format(
        _zarr(2),
        converted(("a.zarr",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "zarr"),
    ),
    "zarr3": Format(
        _zarr(3),
        converted(("a.zarr",), *CAMERA, *MATERIAL, "--flip-y", "yes"),
        needs=("xarray", "zarr"),
    ),
    "vti": Format(
        _vtk,
        converted(("a0.vti", "a1.vti"), *PLAIN),
        needs=("pyvista",),
        only=("a0.vti", "a1.vti"),
    ),
    "vtk": Format(
        _vtk,
        converted(("b0.vtk", "b1.vtk"), *PLAIN),
        needs=("pyvista",),
        text=True,
        only=("b0.vtk", "b1.vtk"),
    ),
    "foam": Format(_foam, converted(("case",), *PLAIN), needs=("pyvista",), text=True),
    "vc7": Format(
        _vc7, converted(("B0.vc7", "B1.vc7", "B2.vc7"), *CAMERA, *MATERIAL), needs=("lvpyio",)
    ),
    "mask": Format(
        _mask,
        converted(("a.npz",), "--mask", "m*.png", *CAMERA, *MATERIAL),
        only=("m0.png", "m1.png"),
    ),
    "surface": Format(
        _line,
        converted(("a.npz",), "--surface", "line.csv", *CAMERA, *MATERIAL),
        text=True,
        only=("line.csv",),
    ),
    "times": Format(
        _line,
        converted(("a.npz",), "--times", "times.txt", "--time-unit", "frame", *CAMERA, *MATERIAL),
        text=True,
        only=("times.txt",),
    ),
}
