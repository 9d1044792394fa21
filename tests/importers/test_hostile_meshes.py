"""Damaged and hostile meshes: VTK crashes on some of them, alone; no other file is opened."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from granpinn.importers import DataFileError, davis, meshes, read_vectors
from tests.importers.test_meshes import foam_case
from tests.opened import watched

pyvista = pytest.importorskip("pyvista")


def grid() -> pyvista.ImageData:
    made = pyvista.ImageData(dimensions=(5, 4, 2))
    made.cell_data["U"] = np.random.default_rng(1).random((made.n_cells, 3))
    return made


def test_a_crash_of_vtk_is_one_sentence(tmp_path: Path) -> None:
    """Connectivity beyond the points of a mesh: VTK reads memory that is not its own."""
    path = tmp_path / "a.vtk"
    grid().cast_to_unstructured_grid().save(path)
    expected = read_vectors(path)
    content = path.read_bytes()
    at = content.index(b"CONNECTIVITY") + 40
    path.write_bytes(content[:at] + b"\x7f" * 64 + content[at + 64 :])
    with pytest.raises(DataFileError, match="cannot be read by") as caught:
        read_vectors(path)
    assert "\n" not in str(caught.value)
    path.write_bytes(content)
    np.testing.assert_array_equal(read_vectors(path).u, expected.u)


def test_declared_terabytes(tmp_path: Path) -> None:
    path = tmp_path / "a.vti"
    grid().save(path)
    content = path.read_bytes().replace(b"0 4 0 3 0 1", b"0 49999 0 39999 0 999")
    path.write_bytes(content)
    with pytest.raises(DataFileError, match=r"a.vti"):
        read_vectors(path)


@pytest.mark.parametrize("suffix", [".vtk", ".vti", ".vc7"])
def test_devices_and_pipes(tmp_path: Path, suffix: str) -> None:
    read = davis.read_vc7 if suffix == ".vc7" else meshes.read
    pipe, link = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link):
        with pytest.raises(DataFileError, match="no regular file|needs LaVision's package"):
            read(path)
        with pytest.raises(DataFileError, match="got a device or a pipe"):
            read_vectors(path)


def _include(case: Path, outside: Path) -> None:
    place = case / "system" / "controlDict"
    place.write_text(place.read_text() + f'\n#include "{outside}"\n')


def _include_above(case: Path, outside: Path) -> None:
    place = case / "0.1" / "U"
    place.write_text(place.read_text() + '\n# include "../../outside"\n')


def _link(case: Path, outside: Path) -> None:
    (case / "0.2" / "U").unlink()
    (case / "0.2" / "U").symlink_to(outside)


def _pipe(case: Path, outside: Path) -> None:
    os.mkfifo(case / "0.2" / "p")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_include, "must include files of its folder only"),
        (_include_above, "must include files of its folder only"),
        (_link, "is a link out of the folder"),
        (_pipe, "must be a regular file"),
    ],
)
def test_a_case_that_leaves_its_folder(
    tmp_path: Path, edit: Callable[[Path, Path], None], message: str
) -> None:
    case, outside = foam_case(tmp_path / "case"), tmp_path / "outside"
    shutil.copy(case / "0.2" / "U", outside)
    edit(case, outside)
    with watched(outside) as opened:
        with pytest.raises(DataFileError, match=message):
            read_vectors(case)
        assert not opened()


@pytest.mark.parametrize("suffix", [".vtkhdf", ".pvd", ".pvtu", ".vtm", ".foam"])
def test_meshes_that_may_name_other_files_are_refused(tmp_path: Path, suffix: str) -> None:
    outside, path = tmp_path / "b.vti", tmp_path / "in" / f"a{suffix}"
    grid().save(outside)
    path.parent.mkdir()
    head = '<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>'
    path.write_text(f'{head}<DataSet timestep="0" file="../b.vti"/></Collection></VTKFile>')
    with watched(outside) as opened:
        for format in ("mesh", "auto"):
            with pytest.raises(DataFileError, match="as others may name files elsewhere"):
                read_vectors(path, format)
        assert not opened()
