"""PIVlab's text exports, in every combination of header, delimiter, units and line ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granpinn.importers import Validity, read_vectors
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


def test_tecplot_zeros_are_not_vectors(tmp_path: Path) -> None:
    """The Tecplot export writes 0 with a column isNaN, and mixes up m/s and m/frame."""
    lines = [
        "# PIVlab by W.Th. & E.J.S., TECPLOT output - 01-Jan-2026",
        "# FRAME: 1, filenames: a & b, conversion factor xy (px -> m): 0.001, conversion ...",
        "# x [m] y [m] u [m/frame] v [m/frame] isNaN?",
        'TITLE = "PIVlab frame: 1"',
        'VARIABLES = "x", "y", "u", "v", "isNaN"',
        'ZONE I=9, J=7, K=1, F=POINT, T="1"',
    ]
    rows = scene.table(0)
    for x, y, u, v, code in rows[np.lexsort((rows[:, 1], rows[:, 0]))]:
        gone = code == Validity.MASKED
        lines.append(f"{x} {y} {0 if gone else u} {0 if gone else v} {int(gone)}")
    fields = read_vectors(scene.write_lines(tmp_path / "a.dat", lines))
    scene.check(fields, 1)
    assert fields.velocity_unit is None
