"""VTK files and an OpenFOAM case, through pyvista."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, read_vectors
from tests.importers import scene

pyvista = pytest.importorskip("pyvista")


def mesh(
    k: int, view: scene.View, *, kind: str = "vti", at: str = "cells", whole: float | None = 1.0
) -> Any:
    """A frame of the scene as a mesh; without a fraction the velocity is NaN where none is known.

    Args:
        kind: suffix of a file that holds such a mesh.
        at: "cells" or "points".
        whole: fraction of a full cell, None = no fraction.
    """
    x, y = view.axes()
    shape, corner = (x.size, y.size), (x.min(), y.min())
    step = (np.ptp(x) / (x.size - 1), np.ptp(y) / (y.size - 1))
    if at == "cells":
        shape = (x.size + 1, y.size + 1)
        corner = (corner[0] - step[0] / 2, corner[1] - step[1] / 2)
    made = pyvista.ImageData(
        dimensions=(*shape, 1 + (at == "cells")), spacing=(*step, min(step)), origin=(*corner, 0)
    )
    upwards = slice(None, None, -1 if view.up else 1)
    u, v = (a[k][upwards].ravel() for a in view.velocity())
    c = scene.fraction()[k][upwards].ravel()
    lost = scene.codes()[k][upwards].ravel() != Validity.VALID
    if whole is None:
        u, v = (np.where(lost, np.nan, a) for a in (u, v))
    data = made.cell_data if at == "cells" else made.point_data
    data["U"] = np.stack([u, v, 0 * u], axis=1)
    if whole is not None:
        data["alpha.grains"] = whole * c
        data["p"] = np.full(u.size, 3.0)
    casts = {
        "vti": lambda: made,
        "vtr": made.cast_to_rectilinear_grid,
        "vts": made.cast_to_structured_grid,
        "vtu": made.cast_to_unstructured_grid,
        "vtk": made.cast_to_unstructured_grid,
        "vtp": lambda: (
            made.extract_surface(algorithm="geometry") if at == "cells" else _cloud(made)
        ),
    }
    return casts[kind]()


def _cloud(made: Any) -> Any:
    cloud = pyvista.PolyData(made.points)
    for name in made.point_data:
        cloud.point_data[name] = made.point_data[name]
    return cloud


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


# A velocity and a fraction in each cell, by the names of times.
FoamFrames = dict[str, tuple[list[str], list[str]]]
FOAM_FRAMES: FoamFrames = {
    time: ([f"({float(time) + cell} {cell + 1} 0)" for cell in range(4)], ["1", "1", "0.5", "0"])
    for time in ("0.1", "0.2")
}


def foam_case(
    case: Path,
    frames: FoamFrames = FOAM_FRAMES,
    x: Sequence[float] = (0, 1, 2),
    y: Sequence[float] = (0, 1, 2),
) -> Path:
    """A flat case, as blockMesh and a solver leave it.

    Args:
        x, y: edges of its cells.
    """
    mesh = case / "constant" / "polyMesh"
    mesh.mkdir(parents=True)
    (case / "system").mkdir()
    control = FOAM.format(kind="dictionary", name="controlDict")
    (case / "system" / "controlDict").write_text(
        control + "startTime 0; endTime 1; deltaT 0.1; writeFormat ascii;\n"
    )
    columns, rows = len(x) - 1, len(y) - 1
    points = [(i, j, z) for z in (0, x[1] - x[0]) for j in y for i in x]

    def vertex(i: int, j: int, k: int) -> int:
        return (k * len(y) + j) * len(x) + i

    inner, outer = [], []
    owner, neighbour, outer_owner = [], [], []
    for j in range(rows):
        for i in range(columns):
            cell = columns * j + i
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
            for face, there, other in (
                (right, i < columns - 1, cell + 1),
                (top, j < rows - 1, cell + columns),
            ):
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
    for time, (velocity, fraction) in frames.items():
        (case / time).mkdir()
        for name, kind, items, dimensions in (
            ("U", "volVectorField", velocity, "[0 1 -1 0 0 0 0]"),
            ("alpha.grains", "volScalarField", fraction, "[0 0 0 0 0 0 0]"),
        ):
            inside = "vector" if name == "U" else "scalar"
            (case / time / name).write_text(
                FOAM.format(kind=kind, name=name)
                + f"dimensions {dimensions};\n"
                + f"internalField nonuniform List<{inside}> {len(items)}\n("
                + "\n".join(items)
                + ");\nboundaryField { walls { type zeroGradient; } }\n"
            )
    return case
