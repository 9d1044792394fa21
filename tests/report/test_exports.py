"""A copy of fields.h5 as ParaView's reader finds it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granpinn.results import (
    Fields,
    write_fields,
)
from tests.run_folder import Contents


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
