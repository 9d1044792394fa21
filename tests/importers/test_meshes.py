"""VTK files and an OpenFOAM case, through pyvista."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, read_vectors
from tests.importers import scene

pyvista = pytest.importorskip("pyvista")

U, V = scene.velocity()
CODES = scene.codes()
GONE = np.isin(CODES, (Validity.MASKED, Validity.INVALID))


def test_image_data_of_vtk(tmp_path: Path) -> None:
    """Cells of a uniform grid, with fraction, pressure and the time."""
    files = []
    for k in range(2):
        grid = pyvista.ImageData(dimensions=(10, 8, 2), spacing=(8, 8, 1), origin=(12, 20, 0))
        u, v = U[k], V[k]
        grid.cell_data["U"] = np.stack([u.ravel(), v.ravel(), 0 * u.ravel()], axis=1)
        grid.cell_data["alpha.grains"] = np.where(CODES[k] == 0, 0.0, 1.0).ravel()
        grid.cell_data["p"] = np.full(u.size, 3.0)
        grid.field_data["TimeValue"] = [0.25 * (k + 1)]
        files.append(tmp_path / f"a{k}.vti")
        grid.save(files[-1])
    fields = read_vectors(files)
    np.testing.assert_allclose(fields.u, U[:2])
    np.testing.assert_allclose(fields.y, scene.Y_DOWN)
    np.testing.assert_allclose(fields.t, [0.25, 0.5])
    assert (fields.c == (CODES[:2] != 0)).all()
    assert fields.p is not None
    assert (fields.p == 3).all()


def test_points_of_vtk_and_scattered_cells(tmp_path: Path) -> None:
    y, x = np.meshgrid(scene.Y_DOWN, scene.X, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    vectors = np.stack(
        [np.where(GONE, np.nan, U)[0].ravel(), np.where(GONE, np.nan, V)[0].ravel(), 0 * x.ravel()],
        axis=1,
    )
    cloud = pyvista.PolyData(points)
    cloud.point_data["velocity_vectors"] = vectors
    cloud.save(tmp_path / "a.vtp")
    fields = read_vectors(tmp_path / "a.vtp")
    fields.__dict__["y_down"] = True
    scene.check(fields, 1, types=False)
    some = pyvista.PolyData(points[::2][:17])
    some.point_data["U"] = vectors[::2][:17] + 1
    some.save(tmp_path / "b.vtp")
    assert read_vectors(tmp_path / "b.vtp").scattered
    cloud.point_data.clear()
    cloud.point_data["T"] = vectors[:, 0]
    cloud.save(tmp_path / "c.vtp")
    with pytest.raises(DataFileError, match="must hold one velocity, got T: name it with --fields"):
        read_vectors(tmp_path / "c.vtp")
    deep = pyvista.ImageData(dimensions=(4, 4, 5))
    deep.cell_data["U"] = np.ones((deep.n_cells, 3))
    deep.save(tmp_path / "d.vti")
    with pytest.raises(DataFileError, match="must be flat, got 4 layers in z"):
        read_vectors(tmp_path / "d.vti")
    (tmp_path / "e.vtk").write_text("# vtk DataFile Version 3.0\nnothing\n")
    with pytest.raises(DataFileError, match=r"e.vtk"):
        read_vectors(tmp_path / "e.vtk")


@pytest.mark.parametrize(
    ("fields", "names", "message"),
    [
        (("U", "alpha.air", "alpha.grains"), {}, "must hold one field c, got alpha.air, alpha.gr"),
        (("U", "velocity"), {}, "must hold one velocity, got U, velocity"),
        (("U", "p", "pressure"), {}, "must hold one field p, got p, pressure"),
        (("U", "alpha.grains"), {"c": "alpha.grain"}, "must hold one field alpha.grain, got alph"),
        (("U", "alpha.air", "alpha.grains"), {"c": "alpha.grains"}, ""),
        (("U", "velocity"), {"u": "velocity"}, ""),
    ],
)
def test_one_of_several_fields_must_be_named(
    tmp_path: Path, fields: tuple[str, ...], names: dict[str, str], message: str
) -> None:
    grid = pyvista.ImageData(dimensions=(10, 8, 2))
    for name in fields:
        shape = (grid.n_cells, 3) if name in ("U", "velocity") else grid.n_cells
        grid.cell_data[name] = np.full(shape, 0.5 if name == "alpha.air" else 1.0)
    grid.save(tmp_path / "a.vti")
    if message:
        with pytest.raises(DataFileError, match=message):
            read_vectors(tmp_path / "a.vti", options={"names": names})
    else:
        found = read_vectors(tmp_path / "a.vti", options={"names": names})
        assert found.c is None or (found.c == 1).all()


def test_a_fraction_must_be_there_at_all_times(tmp_path: Path) -> None:
    case = foam_case(tmp_path / "case")
    (case / "0.2" / "alpha.grains").unlink()
    with pytest.raises(DataFileError, match="must hold the same fields at all times"):
        read_vectors(case)


FOAM = """FoamFile
{{
    version 2.0;
    format ascii;
    class {kind};
    object {name};
}}
"""


def foam_case(case: Path, times: tuple[str, ...] = ("0.1", "0.2")) -> Path:
    """A flat case of 2 x 2 cells, as blockMesh and a solver leave it."""
    mesh = case / "constant" / "polyMesh"
    mesh.mkdir(parents=True)
    (case / "system").mkdir()
    control = FOAM.format(kind="dictionary", name="controlDict")
    (case / "system" / "controlDict").write_text(
        control + "startTime 0; endTime 1; deltaT 0.1; writeFormat ascii;\n"
    )
    points = [(x, y, z) for z in (0, 1) for y in range(3) for x in range(3)]

    def vertex(x: int, y: int, z: int) -> int:
        return points.index((x, y, z))

    inner, outer = [], []
    owner, neighbour, outer_owner = [], [], []
    for j in range(2):
        for i in range(2):
            cell = 2 * j + i
            right = [vertex(i + 1, j, 0), vertex(i + 1, j + 1, 0)]
            right += [vertex(i + 1, j + 1, 1), vertex(i + 1, j, 1)]
            top = [vertex(i, j + 1, 0), vertex(i, j + 1, 1)]
            top += [vertex(i + 1, j + 1, 1), vertex(i + 1, j + 1, 0)]
            left = [vertex(i, j, 0), vertex(i, j, 1), vertex(i, j + 1, 1), vertex(i, j + 1, 0)]
            low = [vertex(i, j, 0), vertex(i + 1, j, 0), vertex(i + 1, j, 1), vertex(i, j, 1)]
            front = [vertex(i, j, 1), vertex(i + 1, j, 1)]
            front += [vertex(i + 1, j + 1, 1), vertex(i, j + 1, 1)]
            back = [vertex(i, j, 0), vertex(i, j + 1, 0)]
            back += [vertex(i + 1, j + 1, 0), vertex(i + 1, j, 0)]
            for face, there, other in ((right, i < 1, cell + 1), (top, j < 1, cell + 2)):
                if there:
                    inner.append(face)
                    owner.append(cell)
                    neighbour.append(other)
                else:
                    outer.append(face)
                    outer_owner.append(cell)
            for face, there in ((left, i == 0), (low, j == 0), (front, True), (back, True)):
                if there:
                    outer.append(face)
                    outer_owner.append(cell)

    def write(name: str, kind: str, items: list[str]) -> None:
        text = FOAM.format(kind=kind, name=name) + f"{len(items)}\n(\n" + "\n".join(items) + "\n)\n"
        (mesh / name).write_text(text)

    write("points", "vectorField", ["({} {} {})".format(*point) for point in points])
    faces = [*inner, *outer]
    write("faces", "faceList", ["4(" + " ".join(map(str, face)) + ")" for face in faces])
    write("owner", "labelList", [str(cell) for cell in (*owner, *outer_owner)])
    write("neighbour", "labelList", [str(cell) for cell in neighbour])
    patch = f"walls {{ type wall; nFaces {len(outer)}; startFace {len(inner)}; }}"
    write("boundary", "polyBoundaryMesh", [patch])
    for time in times:
        (case / time).mkdir()
        u = [f"({float(time) + cell} {cell + 1} 0)" for cell in range(4)]
        for name, kind, items, dimensions in (
            ("U", "volVectorField", u, "[0 1 -1 0 0 0 0]"),
            ("alpha.grains", "volScalarField", ["1", "1", "0.5", "0"], "[0 0 0 0 0 0 0]"),
        ):
            inside = "vector" if name == "U" else "scalar"
            (case / time / name).write_text(
                FOAM.format(kind=kind, name=name)
                + f"dimensions {dimensions};\ninternalField nonuniform List<{inside}> 4\n("
                + "\n".join(items)
                + ");\nboundaryField { walls { type zeroGradient; } }\n"
            )
    return case


def test_openfoam(tmp_path: Path) -> None:
    fields = read_vectors(foam_case(tmp_path / "case"))
    np.testing.assert_allclose(fields.t, [0.1, 0.2])
    np.testing.assert_allclose(fields.x, [0.5, 1.5])
    np.testing.assert_allclose(fields.u[1], [[0.2, 1.2], [2.2, 3.2]])
    assert fields.c is not None
    np.testing.assert_allclose(fields.c[0], [[1, 1], [0.5, 0]])
