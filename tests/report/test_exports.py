"""results.csv and fields.vtkhdf, as a spreadsheet and as ParaView's reader find them."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from granpinn import report
from granpinn.report import vtkhdf
from granpinn.results import (
    Fields,
    Parameter,
    Parameters,
    Result,
    write_csv,
    write_fields,
)
from tests.examples import PARAMETERS, make_result
from tests.run_folder import Contents


def read(result: Result, path: Path) -> dict[str, str]:
    write_csv(result, path)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1
    return rows[0]


def test_the_row_holds_values_intervals_and_units(tmp_path: Path) -> None:
    value = 0.1 + 0.2  # needs all 17 digits
    parameters = Parameters(PARAMETERS | {"mu_s": Parameter(value, False, 0.012, (0.28, 0.32))})
    row = read(make_result(parameters=parameters), tmp_path / "results.csv")
    assert float(row["mu_s"]) == value
    found = [row[f"mu_s_{name}"] for name in ("std", "low_90", "high_90", "unit", "fixed", "true")]
    assert found == ["0.012", "0.28", "0.32", "1", "False", "0.4"]
    assert (row["I0"], row["I0_fixed"], row["I0_std"]) == ("0.3", "True", "")
    assert (row["error_velocity"], row["error_unit"]) == ("0.8", "%")
    assert (row["I_q05"], row["I_q95"]) == ("0.0001", "0.3")
    assert (row["input"], row["level"], row["seed"]) == ("Säule µ.h5", "V1", "7")
    assert (row["steps"], row["wall_unit"]) == ("4000", "s")


def test_the_reader_of_paraview_finds_every_value(contents: Contents, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista", reason="pyvista, extra mesh, is not installed")
    from vtkmodules.vtkIOHDF import vtkHDFReader

    fields, path = contents.fields, tmp_path / "fields.vtkhdf"
    assert not vtkhdf.write_vtkhdf(fields, path)
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    assert reader.CanReadFile(str(path))
    for k in (0, fields.t.size // 2, fields.t.size - 1):
        reader.UpdateTimeStep(fields.t[k])
        image = pyvista.wrap(reader.GetOutputDataObject(0))
        assert image.dimensions == (fields.x.size, fields.y.size, 1)
        np.testing.assert_allclose(image.points[:: fields.x.size, 1], fields.y, atol=1e-6)
        np.testing.assert_allclose(image.points[: fields.x.size, 0], fields.x, atol=1e-6)
        for name in ("p", "I", "D2", "eta", "tau_xy", "p_reference"):
            found = image.point_data[name].reshape(fields.shape[1:])
            np.testing.assert_array_equal(found, fields.frame(name, k))
        velocity = image.point_data["velocity"].reshape(*fields.shape[1:], 3)
        np.testing.assert_array_equal(velocity[..., 0], fields.frame("u", k))
        np.testing.assert_array_equal(velocity[..., 1], fields.frame("v", k))
        assert np.nanmax(np.abs(velocity[..., 2])) == 0
        grains = image.point_data["c"].reshape(fields.shape[1:])
        np.testing.assert_array_equal(grains, fields.c[k])


def test_the_file_has_the_layout_of_the_format(contents: Contents, tmp_path: Path) -> None:
    fields, path = contents.fields, tmp_path / "fields.vtkhdf"
    vtkhdf.write_vtkhdf(fields, path)
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"ImageData"
        assert root.attrs["Version"].tolist() == [2, 0]
        extent = [0, fields.x.size - 1, 0, fields.y.size - 1, 0, 0]
        assert root.attrs["WholeExtent"].tolist() == extent
        assert root["Steps"].attrs["NSteps"] == fields.t.size
        np.testing.assert_array_equal(root["Steps/Values"], fields.t)
        assert set(root["PointData"]) == set(root["Steps/PointDataOffsets"])
        assert root["PointData/p"].shape == fields.shape
        assert root["PointData/velocity"].shape == (*fields.shape, 3)


def uneven(fields: Fields) -> Fields:
    """The same values at points that drift apart by up to half a cell."""
    x = fields.x.copy()
    x[1:-1] += 0.45 * (x[1] - x[0]) * np.sin(np.arange(1, x.size - 1))
    return replace(fields, x=x)


def test_an_uneven_grid_is_moved_and_that_is_said(
    run_dir: Path, contents: Contents, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = uneven(contents.fields)
    write_fields(fields, run_dir / "fields.h5")
    path = report.for_paraview(run_dir)
    assert "fields.vtkhdf: the grid is uneven" in capsys.readouterr().err
    axis = vtkhdf.even(fields.x)
    with h5py.File(path) as file:
        found = file["VTKHDF/PointData/p"][1]
    np.testing.assert_array_equal(found, fields.frame("p", 1)[:, axis.points])
