"""results.csv and a copy of fields.h5, as a spreadsheet and as ParaView's reader find them."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

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
    assert (row["I_low"], row["I_high"]) == ("0.01", "0.2")
    assert (row["input"], row["level"], row["seed"]) == ("Säule µ.h5", "V1", "7")
    assert (row["steps"], row["wall_unit"]) == ("4000", "s")


def test_the_reader_of_paraview_finds_every_value(run_dir: Path, contents: Contents) -> None:
    """On an uneven grid, whose points stay where they are."""
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed")
    from vtkmodules.vtkIONetCDF import vtkNetCDFCFReader

    fields = uneven(contents.fields)
    write_fields(fields, run_dir / "fields.h5")
    reader = vtkNetCDFCFReader()
    shutil.copyfile(run_dir / "fields.h5", run_dir / "fields.nc")
    reader.SetFileName(str(run_dir / "fields.nc"))
    for k in (0, fields.t.size // 2, fields.t.size - 1):
        reader.UpdateTimeStep(fields.t[k])
        grid = pyvista.wrap(reader.GetOutputDataObject(0))
        assert grid.dimensions == (fields.x.size, fields.y.size, 1)
        np.testing.assert_allclose(grid.points[:: fields.x.size, 1], fields.y, atol=1e-6)
        np.testing.assert_allclose(grid.points[: fields.x.size, 0], fields.x, atol=1e-6)
        for name in ("u", "v", "p", "I", "D2", "eta", "tau_xy", "p_reference"):
            found = grid.point_data[name].reshape(fields.shape[1:])
            np.testing.assert_array_equal(found, fields.frame(name, k))
        grains = grid.point_data["c"].reshape(fields.shape[1:])
        np.testing.assert_array_equal(grains, fields.c[k])


def uneven(fields: Fields) -> Fields:
    """The same values at points that drift apart by up to half a cell."""
    x = fields.x.copy()
    x[1:-1] += 0.45 * (x[1] - x[0]) * np.sin(np.arange(1, x.size - 1))
    return replace(fields, x=x)
