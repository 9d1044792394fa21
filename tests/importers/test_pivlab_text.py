"""PIVlab's text exports, in every combination of header, delimiter, units and line ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, read_vectors
from tests.importers import scene

KIND = {Validity.VALID: 1, Validity.INTERPOLATED: 2, Validity.INVALID: 2, Validity.MASKED: 0}


def export(
    path: Path,
    k: int = 0,
    *,
    view: scene.View = scene.PIXELS,
    info: bool = True,
    header: bool = True,
    types: bool = True,
    derivatives: bool = False,
    gone: str = "NaN",
    newline: str = "\r\n",
    **style: str,
) -> Path:
    """A frame as PIVlab's "ASCII chart" export writes it: y runs first.

    Args:
        gone: u and v where there is no vector.
        style: of `scene.write_table`.
    """
    xy, uv = (1, 1) if view.x == "px" else (scene.SI["px"], scene.si("px/frame"))
    head = [
        "PIVlab, ASCII chart output - 01-Jan-2026",
        f"FRAME: {k + 1}, filenames: a, 1.tif & b.tif, conversion factor xy (px -> m): {xy}, "
        f"conversion factor uv (px/frame -> m/s): {uv}",
    ]
    names = [f"{name} [{unit}]" for name, unit in zip("xyuv", view.units, strict=True)]
    names += ["Vector type [-]"] if types else []
    more = [
        "shear rate (magnitude of the rate-of-strain tensor) [1/frame]",
        "uncertainty [px/frame]",
    ]
    names += more if derivatives else []
    rows = []
    columns = scene.table(k, view).reshape(scene.ROWS, scene.COLUMNS, 5).swapaxes(0, 1)
    for x, y, u, v, code in columns.reshape(-1, 5):
        filled = code == Validity.VALID or (types and code == Validity.INTERPOLATED)
        cells = scene.text(x, y) + (scene.text(u, v) if filled else [gone, gone])
        cells += [str(KIND[Validity(int(code))])] if types else []
        rows.append(cells + (["0.5", "NaN"] if derivatives else []))
    names = names if header else []
    return scene.write_table(path, head if info else [], names, rows, newline=newline, **style)


def test_a_series_is_sorted_by_number(tmp_path: Path) -> None:
    """FRAME says the time; the order of the arguments and of the alphabet does not matter."""
    for name, k in (("p_10.txt", 2), ("p_9.txt", 1), ("p_1.txt", 0)):
        export(tmp_path / name, k)
    scene.check(read_vectors(tmp_path))
    fields = read_vectors(str(tmp_path / "p_*.txt"))
    np.testing.assert_array_equal(fields.t, [0, 1, 2])
    assert fields.time_unit == "frame"


@pytest.mark.parametrize("form", ["tecplot", "no names"])
def test_columns_without_one_line_of_names_are_refused(tmp_path: Path, form: str) -> None:
    """The Tecplot export mixes up m/s and m/frame."""
    path = export(tmp_path / "a.txt", header=False)
    first, second, *rows = path.read_text().splitlines()
    more = ["x [m] y [m] u [m/frame] v [m/frame] isNaN?", 'TITLE = "PIVlab frame: 1"']
    lines = [first, second, *(more if form == "tecplot" else []), *rows]
    with pytest.raises(DataFileError, match="must have the columns|cells in every row"):
        read_vectors(scene.write_lines(path, lines))
