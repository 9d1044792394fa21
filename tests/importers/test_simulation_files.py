"""NumPy arrays, netCDF, zarr, Basilisk, VTK and OpenFOAM."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, from_arrays, read_vectors
from tests.importers import scene

U, V = scene.velocity()
CODES = scene.codes()
GONE = np.isin(CODES, (Validity.MASKED, Validity.INVALID))
ARRAYS: dict[str, Any] = {
    "t": np.arange(3) / 500,
    "y": scene.Y_DOWN,
    "x": scene.X,
    "u": np.where(GONE, np.nan, U),
    "v": np.where(GONE, np.nan, V),
    "length_unit": "px",
    "time_unit": "s",
    "velocity_unit": "px/s",
    "y_down": True,
}


def test_arrays_in_memory_and_in_a_file(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **ARRAYS)
    for fields in (from_arrays(ARRAYS), read_vectors(tmp_path / "a.npz")):
        scene.check(fields, types=False)
        assert (fields.length_unit, fields.velocity_unit) == ("px", "px/s")
        np.testing.assert_array_equal(fields.t, ARRAYS["t"])
    coded = from_arrays(ARRAYS | {"u": U, "v": V, "validity": CODES})
    scene.check(coded)
    masked = from_arrays(ARRAYS | {"mask": CODES == Validity.MASKED})
    scene.check(masked, types=False)


def test_scattered_arrays() -> None:
    points = {name: np.arange(4.0) for name in ("t", "y", "x", "u")}
    fields = from_arrays(points | {"v": [1, 2, np.nan, 4]})
    assert fields.scattered
    assert fields.count(Validity.INVALID) == 1
    assert np.isnan(fields.u[2])


WRONG_ARRAYS = {
    "no v": ({"v": None}, "got no v"),
    "shapes": ({"v": V[:, 1:]}, "u and v must be \\[T, Y, X\\]"),
    "transposed": ({"u": U.T, "v": V.T}, "u must have the shape \\[3, 7, 9\\] of t, y, x"),
    "unknown": ({"w": V}, "unknown array w"),
    "codes": ({"validity": CODES + 5}, "validity must be 0, 1, 2 or 3"),
    "code shape": ({"validity": CODES[1:]}, "must have one shape"),
    "mask shape": ({"mask": CODES[0]}, "mask must have the shape"),
    "text": ({"u": np.full(U.shape, "a")}, "must hold numbers"),
    "time of NaN": ({"t": [0, np.nan, 1]}, "t must be finite"),
    "time twice": ({"t": [0, 1, 1]}, "t must have every value once, got 1 twice"),
}


@pytest.mark.parametrize(("change", "message"), WRONG_ARRAYS.values(), ids=WRONG_ARRAYS.keys())
def test_wrong_arrays_are_refused(change: dict[str, Any], message: str) -> None:
    arrays = {name: value for name, value in (ARRAYS | change).items() if value is not None}
    with pytest.raises(DataFileError, match=message):
        from_arrays(arrays)


def test_damaged_npz_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **ARRAYS)
    content = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(DataFileError, match="cannot be read as .npz"):
        read_vectors(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", u=np.array([{}, {}], dtype=object))
    with pytest.raises(DataFileError, match="cannot be read as .npz"):
        read_vectors(tmp_path / "b.npz")


def dataset(**extras: Any) -> Any:
    """In the schema of pivpy, dimensions in its order (y, x, t); 0 where chc says nothing is."""
    xarray = pytest.importorskip("xarray")
    chc = np.select([CODES == Validity.VALID, CODES == Validity.INTERPOLATED], [1, 5], 0)
    chc[CODES == Validity.INVALID] = -1
    dims = ("y", "x", "t")
    data = {
        "u": (dims, np.moveaxis(np.where(GONE, 0.0, U), 0, -1), {"units": "pix/dt"}),
        "v": (dims, np.moveaxis(np.where(GONE, 0.0, V), 0, -1), {"units": "pix/dt"}),
        "chc": (dims, np.moveaxis(chc, 0, -1)),
        **{name: (dims, np.moveaxis(value, 0, -1)) for name, value in extras.items()},
    }
    axes = {"x": ("x", scene.X, {"units": "pix"}), "y": ("y", scene.Y_DOWN, {"units": "pix"})}
    axes["t"] = ("t", np.arange(3.0), {"units": "frame"})
    return xarray.Dataset(data, axes)


@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_netcdf_and_zarr(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"a.{kind}"
    data = dataset(sigma_u=0.1 + U, sigma_v=0.2 + V)
    if kind == "nc":
        data.to_netcdf(path, engine="h5netcdf")
    else:
        pytest.importorskip("zarr")
        data.to_zarr(path, zarr_format=2, consolidated=True)
    fields = read_vectors(path)
    fields.__dict__["y_down"] = True
    scene.check(fields)
    assert (fields.length_unit, fields.velocity_unit) == ("pix", "pix/frame")
    assert fields.sigma_v is not None
    np.testing.assert_allclose(fields.sigma_v, 0.2 + V)


def test_netcdf_of_another_layout_is_refused(tmp_path: Path) -> None:
    data = dataset()
    data.rename(u="ux").to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(DataFileError, match="got no u"):
        read_vectors(tmp_path / "a.nc")
    data.expand_dims("z").to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(DataFileError, match="u must have the dimensions t, y, x"):
        read_vectors(tmp_path / "b.nc")
    content = (tmp_path / "a.nc").read_bytes()
    (tmp_path / "c.nc").write_bytes(content[: len(content) // 2])
    with pytest.raises(DataFileError, match="cannot be read by xarray"):
        read_vectors(tmp_path / "c.nc")


def test_zarr_that_unpickles_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    (tmp_path / "a.zarr" / "u").mkdir(parents=True)
    (tmp_path / "a.zarr" / ".zgroup").write_text('{"zarr_format": 2}')
    (tmp_path / "a.zarr" / "u" / ".zarray").write_text(
        '{"zarr_format": 2, "shape": [3],'
        ' "chunks": [3], "dtype": "<f8", "filters": [{"id": "pickle"}]}'
    )
    with pytest.raises(DataFileError, match="got 'pickle': another codec can run foreign code"):
        read_vectors(tmp_path / "a.zarr")


@pytest.mark.parametrize(("module", "name"), [("xarray", "a.nc"), ("pyvista", "a.vtk")])
def test_missing_packages_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(b"CDF\x01" if module == "xarray" else b"# vtk DataFile\n")
    with pytest.raises(DataFileError, match=f"needs {module}: pip install 'granpinn"):
        read_vectors(tmp_path / name)


def basilisk(path: Path, k: int = 0) -> Path:
    """x is the outer loop; nodata prints as inf."""
    lines = ["# 1:x 2:y 3:f 4:p 5:u.x 6:u.y"]
    rows = scene.table(k)
    rows[:, 1] = 100 - rows[:, 1]
    for x in scene.X:
        column = rows[rows[:, 0] == x]
        for _, y, u, v, code in column[np.argsort(column[:, 1])]:
            inside = code not in (Validity.MASKED, Validity.INVALID)
            values = (
                f"{0.9 + 0.1 * (x > 20):.9g} 2.5 {u:.9g} {-v:.9g}" if inside else "inf inf inf inf"
            )
            lines.append(f"{x:g} {y:g} {values}")
        lines.append("")
    return scene.write_lines(path, lines)


def test_basilisk(tmp_path: Path) -> None:
    fields = read_vectors([basilisk(tmp_path / f"out-{k}.txt", k) for k in range(scene.FRAMES)])
    expected = CODES[:, ::-1].copy()
    expected[expected == Validity.INVALID] = Validity.MASKED
    expected[expected == Validity.INTERPOLATED] = Validity.VALID
    np.testing.assert_array_equal(fields.validity, expected)
    assert fields.c is not None
    assert fields.p is not None
    there = fields.usable
    np.testing.assert_allclose(fields.v[there], -V[:, ::-1][there], rtol=1e-6)
    assert set(np.unique(fields.c)) == {0.0, 0.9, 1.0}
    assert np.isnan(fields.p[~there]).all()
    assert (fields.p[there] == 2.5).all()
    named = read_vectors(tmp_path / "out-0.txt", options={"names": {"p": "f"}})
    assert named.p is not None
    assert np.nanmax(named.p) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.replace("5:u.x", "5:w"), "must have the columns u.x, got x, y, f, p, w, u.y"),
        (lambda s: s.replace(" 6:u.y", " 6:u.y 7:q"), "line 2: expected 7 cells as above, got 6"),
        (lambda s: s[: len(s) // 2], "expected 6 cells|full grid"),
    ],
)
def test_wrong_basilisk_is_refused(tmp_path: Path, change: Any, message: str) -> None:
    path = basilisk(tmp_path / "a.txt")
    path.write_text(change(path.read_text()))
    with pytest.raises(DataFileError, match=message):
        read_vectors(path)
