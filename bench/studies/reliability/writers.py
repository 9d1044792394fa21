"""Writers of valid files, small ones, for every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.commands import train
from granpinn.data import Particles, Surface, particle_flow, write_flow
from tests.flows import make_flow
from tests.importers import scene, test_pivlab_mat, test_surface
from tests.importers.test_simulation_files import ARRAYS, dataset
from tests.importers.test_tracks import motion, write_csv

TRAINING = (
    *("--steps", "2", "--network.widths", "6", "--batch.interior", "8", "--batch.surface", "4"),
    *("--log-every", "1", "--device", "cpu"),
)
NO_PRESSURE = ("--simulated_pressure.frames", "0")

Writer = Callable[[Path], object]  # writes valid files to a folder


def flow(folder: Path) -> None:
    write_flow(make_flow(frames=6, rows=10, columns=8), folder / "flow.h5")


def particles(folder: Path) -> None:
    flow = make_flow(frames=6, rows=10, columns=8)
    frame, row, column = flow.valid.nonzero()
    values = {name: getattr(flow, name)[flow.valid].astype(float) for name in "uv"}
    points = Particles(t=flow.t[frame], y=flow.y[row], x=flow.x[column], **values)
    kept = ("gravity", "density", "grain_diameter", "length_unit", "time_unit")
    others = {name: getattr(flow, name) for name in kept}
    line = flow.surface
    assert line is not None
    inside = np.ones(line.t.size, bool)
    for n in "yx":  # the grid of a report is smaller
        at, grains = getattr(line, n), getattr(points, n)
        margin = 0.2 * np.ptp(grains)
        inside &= (at > grains.min() + margin) & (at < grains.max() - margin)
    surface = Surface(t=line.t[inside], x=line.x[inside], y=line.y[inside])
    write_flow(particle_flow(points, surface=surface, **others), folder / "flow.h5")


def run(folder: Path) -> None:
    flow(folder)
    assert train.main(["flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE]) == 0
    (folder / "run" / "report.html").unlink()
    (folder / "flow.h5").unlink()
    for path in [*folder.rglob("*.png"), *folder.rglob("*.safetensors")]:
        path.unlink()


def frames(name: str, write: Callable[[Path, int], object]) -> Writer:
    """Three frames, one file each."""
    return lambda folder: [write(folder / name.format(k), k) for k in range(3)]


def mat(version: str, content: str) -> Writer:
    write, made = (getattr(test_pivlab_mat, name) for name in (version, content))
    return lambda folder: write(folder / "a.mat", made())


def npz(folder: Path) -> None:
    np.savez(folder / "a.npz", **ARRAYS)


def netcdf(folder: Path) -> None:
    dataset().to_netcdf(folder / "a.nc", engine="h5netcdf")


def tracks(folder: Path) -> None:
    write_csv(folder / "a.csv", motion(tracks=6))


def vtk(folder: Path) -> None:
    from tests.importers.test_meshes import mesh

    for k in range(2):
        for kind, name in (("vti", f"a{k}.vti"), ("vtr", f"b{k}.vtk")):
            grid: Any = mesh(k, scene.PIXELS, kind=kind)
            grid.field_data["TimeValue"] = [0.25 * (k + 1)]
            grid.save(folder / name, binary=kind == "vti")


def foam(folder: Path) -> None:
    from tests.importers.test_meshes import foam_case

    (folder / "case").mkdir()
    foam_case(folder / "case")
    (folder / "case" / "case.foam").write_bytes(b"")


def vc7(folder: Path) -> None:
    import lvpyio

    for k in range(3):
        frame = np.zeros((scene.ROWS, scene.COLUMNS), dtype=lvpyio.vec2c)
        frame["u"], frame["v"] = (part[k] for part in scene.velocity())
        masked = np.ma.array(frame, mask=scene.codes()[k] == 0)
        buffer = lvpyio.arrays_to_buffer([masked])
        buffer[0].grid.x = buffer[0].grid.y = scene.X[1] - scene.X[0]
        lvpyio.write_buffer(buffer, str(folder / f"B{k}.vc7"))


def mask(folder: Path) -> None:
    np.savez(folder / "a.npz", **test_surface.in_pixels())
    for k in range(3):
        bright = np.kron(test_surface.C[k, ::-1] > 0.5, np.ones((10, 10))) > 0
        test_surface.write_image(folder / f"m{k}.png", bright)


def line(folder: Path) -> None:
    mask(folder)
    (folder / "times.txt").write_text("t [ms]\n10\n25\n60\n")
    test_surface.line_file(folder / "line.csv", "frame,x,y", factor=10.0)
