"""Writers of valid files, small ones, for every format."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

TRAINING = (
    *("--steps", "2", "--network.widths", "6", "--batch.interior", "8", "--batch.surface", "4"),
    *("--log-every", "1", "--device", "cpu"),
)
NO_PRESSURE = ("--simulated_pressure.frames", "0")


def flow(folder: Path, **changes: Any) -> None:
    from granpinn.data import write_flow
    from tests.flows import make_flow

    write_flow(make_flow(frames=6, rows=10, columns=8, **changes), folder / "flow.h5")


def particles(folder: Path) -> None:
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


def run(folder: Path) -> None:
    from granpinn.commands.train import main

    flow(folder)
    assert main(["flow.h5", "--out", "run", *TRAINING, *NO_PRESSURE]) == 0
    (folder / "run" / "report.html").unlink()
    (folder / "flow.h5").unlink()
    for path in [*folder.rglob("*.png"), *folder.rglob("*.safetensors")]:
        path.unlink()


def frames(name: str, write: Callable[[Path, int], object]) -> Callable[[Path], object]:
    """Three frames, one file each."""
    return lambda folder: [write(folder / name.format(k), k) for k in range(3)]


def by_name(module: str, function: str) -> Callable[..., Any]:
    """A writer of tests/importers, imported when it is called."""
    return lambda *args, **options: getattr(
        importlib.import_module(f"tests.importers.{module}"), function
    )(*args, **options)


def mat(version: str, content: str) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        from tests.importers import test_pivlab_mat as mat

        getattr(mat, version)(folder / "a.mat", getattr(mat, content)())

    return write


def npz(folder: Path) -> None:
    import numpy as np

    from tests.importers.test_simulation_files import ARRAYS

    np.savez(folder / "a.npz", **ARRAYS)


def netcdf(folder: Path) -> None:
    from tests.importers.test_simulation_files import dataset

    dataset().to_netcdf(folder / "a.nc", engine="h5netcdf")


def zarr(version: int) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        import warnings

        from tests.importers.test_simulation_files import dataset

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            dataset().to_zarr(folder / "a.zarr", zarr_format=version)

    return write


def tracks(folder: Path) -> None:
    from tests.importers.test_tracks import motion, write_csv

    write_csv(folder / "a.csv", motion(tracks=6))


def tracks_hdf5(folder: Path) -> None:
    import warnings

    import pandas as pd

    from tests.importers.test_tracks import motion

    table = pd.DataFrame(motion(0.05, tracks=6)).astype({"frame": int, "particle": int})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pd.HDFStore(folder / "a.h5") as store:
            store.append("FrameData", table, data_columns=["frame"])


def vtk(folder: Path) -> None:
    from tests.importers.scene import PIXELS
    from tests.importers.test_meshes import mesh

    for k in range(2):
        for kind, name in (("vti", f"a{k}.vti"), ("vtr", f"b{k}.vtk")):
            grid = mesh(k, PIXELS, kind=kind)
            grid.field_data["TimeValue"] = [0.25 * (k + 1)]
            grid.save(folder / name, binary=kind == "vti")


def foam(folder: Path) -> None:
    from tests.importers.test_meshes import foam_case

    (folder / "case").mkdir()
    foam_case(folder / "case")
    (folder / "case" / "case.foam").write_bytes(b"")


def vc7(folder: Path) -> None:
    import lvpyio
    import numpy as np

    from tests.importers import scene

    for k in range(3):
        frame = np.zeros((scene.ROWS, scene.COLUMNS), dtype=lvpyio.vec2c)
        frame["u"], frame["v"] = (part[k] for part in scene.velocity())
        masked = np.ma.array(frame, mask=scene.codes()[k] == 0)
        buffer = lvpyio.arrays_to_buffer([masked])
        buffer[0].grid.x = buffer[0].grid.y = scene.X[1] - scene.X[0]
        lvpyio.write_buffer(buffer, str(folder / f"B{k}.vc7"))


def mask(folder: Path) -> None:
    import numpy as np

    from tests.importers import test_surface as surface

    arrays = surface.in_pixels()
    np.savez(folder / "a.npz", **arrays)
    for k in range(3):
        bright = np.kron(surface.C[k, ::-1] > 0.5, np.ones((10, 10))) > 0
        surface.write_image(folder / f"m{k}.png", bright)


def line(folder: Path) -> None:
    from tests.importers import test_surface as surface

    mask(folder)
    (folder / "times.txt").write_text("t [ms]\n10\n25\n60\n")
    surface.line_file(folder / "line.csv", "frame,x,y", factor=10.0)
