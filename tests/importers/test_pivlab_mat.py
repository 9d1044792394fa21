"""PIVlab's MATLAB files: one frame, all frames, session; of version 5 and of version 7.3."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from granpinn.importers import DataFileError, Validity, read_vectors
from tests.importers import scene
from tests.importers.test_pivlab_text import KIND

Writer = Callable[[Path, dict[str, Any]], Path]


def cell(items: list[Any]) -> Any:
    column = np.empty((len(items), 1), object)
    for i, item in enumerate(items):
        column[i, 0] = item
    return column


def version_5(path: Path, variables: dict[str, Any], **options: Any) -> Path:
    savemat(path, variables, **options)
    return path


def version_73(path: Path, variables: dict[str, Any]) -> Path:
    """As MATLAB writes it: arrays transposed, cells as references, an empty one by attribute."""
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(name: str, matrix: Any) -> h5py.Dataset:
            matrix = np.atleast_2d(matrix)
            if matrix.size == 0:
                dataset = file.create_dataset(name, data=np.zeros(2, np.uint64))
                dataset.attrs["MATLAB_empty"] = np.uint8(1)
                return dataset
            return file.create_dataset(name, data=matrix.T)

        for name, value in variables.items():
            if isinstance(value, str):
                text = put(name, np.array([ord(letter) for letter in value], np.uint16))
                text.attrs["MATLAB_class"] = np.bytes_("char")
                continue
            if np.asarray(value).dtype.kind != "O":
                put(name, value)
                continue
            references = np.empty(value.shape, h5py.ref_dtype)
            for i, (index, item) in enumerate(np.ndenumerate(value)):
                references[index] = put(f"#refs#/{name}{i}", item).ref
            file.create_dataset(name, data=references.T, dtype=h5py.ref_dtype)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(512))
    return path


def matrices(
    view: scene.View = scene.PIXELS, *, gone: float = np.nan, types: bool = True
) -> dict[str, list[Any]]:
    """x, y, u, v, typevector of every frame; `gone` where there is no vector."""
    codes = scene.codes()
    filled = np.isin(codes, (Validity.VALID, Validity.INTERPOLATED)[: 1 + types])
    u, v = (np.where(filled, a, gone) for a in view.velocity())
    x, y = view.axes()
    y, x = np.meshgrid(y, x, indexing="ij")
    n = scene.FRAMES
    found = {"x": [x] * n, "y": [y] * n, "u": list(u), "v": list(v)}
    kinds = np.vectorize(lambda code: float(KIND[Validity(int(code))]))(codes)
    return found | ({"typevector": list(kinds)} if types else {})


def calibration(view: scene.View) -> tuple[float, float]:
    """calxy and calu, 1 for data in pixels."""
    return (1.0, 1.0) if view.x == "px" else (scene.SI["px"], scene.si("px/frame"))


def one_frame(k: int = 0, view: scene.View = scene.PIXELS, **options: Any) -> dict[str, Any]:
    frame = {name: parts[k] for name, parts in matrices(view, **options).items()}
    xy, uv = calibration(view)
    return frame | {"calxy": xy, "caluv": -uv if view.up else uv}


def all_frames(view: scene.View = scene.PIXELS, **options: Any) -> dict[str, Any]:
    m = matrices(view, **options)
    found = {"x": cell(m.pop("x")), "y": cell(m.pop("y"))}
    for name, parts in m.items():
        found[f"{name}_filtered"] = cell(parts)
        found[f"{name}_original"] = cell(
            parts if name == "typevector" else [9 + part for part in parts]
        )
    xy, uv = calibration(view)
    nothing = cell([np.empty((0, 0))] * scene.FRAMES)
    return found | {"u_smoothed": nothing, "calxy": xy, "calu": uv, "calv": uv}


WRITERS = pytest.mark.parametrize("write", [version_5, version_73])


@WRITERS
@pytest.mark.parametrize(
    ("facts", "unit"),
    [
        ({"units": "[m] respectively [m/s]"}, "m/s"),
        ({"units": "[m] respectively [m/frame]"}, "m/frame"),
        ({"displacement_only": 1.0}, "m/frame"),
        ({"units": "[\N{MICRO SIGN}m]"}, "m/s"),
    ],
)
def test_calibrated_without_a_time_step(
    tmp_path: Path, write: Writer, facts: dict[str, Any], unit: str
) -> None:
    """Meters per frame: taken for m/s they would be too slow by the frame rate."""
    fields = read_vectors(write(tmp_path / "d.mat", all_frames(scene.METERS) | facts))
    assert (fields.length_unit, fields.velocity_unit) == ("m", unit)


def _transposed(variables: dict[str, Any]) -> None:
    variables["u_filtered"][1, 0] = variables["u_filtered"][1, 0].T


def _other_grid(variables: dict[str, Any]) -> None:
    variables["x"][2, 0] = variables["x"][2, 0] + 1


def _no_frames(variables: dict[str, Any]) -> None:
    for name in ("u", "v", "typevector"):
        for kind in ("original", "filtered"):
            variables[f"{name}_{kind}"] = cell([np.empty((0, 0))] * scene.FRAMES)


def _no_x(variables: dict[str, Any]) -> None:
    variables["x"][1, 0] = np.empty((0, 0))


def _no_y_at_first(variables: dict[str, Any]) -> None:
    variables["y"].flat[0] = np.empty(0, object)


def _types_in_one_frame(m: dict[str, Any]) -> None:
    m["typevector_filtered"][1, 0] = np.empty((0, 0))


def _turned(m: dict[str, Any]) -> None:
    y = m["y"][0, 0] + 0.01 * m["x"][0, 0]
    m["y"] = cell([y] * scene.FRAMES)


def _two_scales(m: dict[str, Any]) -> None:
    m["calxy"] = np.array([[1e-3, 2e-3]])


WRONG: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "transposed": (_transposed, "matrices x, y, u, v of one size, one grid.*in frame 2"),
    "another grid": (_other_grid, "one grid.*in frame 3"),
    "no x": (_no_x, "matrices x, y, u, v of one size"),
    "no y in the first frame": (_no_y_at_first, "something else in frame 1"),
    "no frames": (_no_frames, "holds no analyzed frame"),
    "types": (_types_in_one_frame, "vector types in all frames or in none"),
    "rows": (_turned, "must have one y in every row, got several"),
    "scales": (_two_scales, "calxy must be one number, got 2"),
}


@WRITERS
@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_content_is_refused(
    tmp_path: Path, write: Writer, change: Callable[[dict[str, Any]], None], message: str
) -> None:
    variables = all_frames(scene.METERS)
    change(variables)
    with pytest.raises(DataFileError, match=message):
        read_vectors(write(tmp_path / "a.mat", variables))
