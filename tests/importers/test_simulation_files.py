"""NumPy arrays, data sets of xarray, and Basilisk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, Validity, from_arrays
from granpinn.importers.arrays import from_dataset
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


WRONG_ARRAYS = {
    "no v": ({"v": None}, "got no v"),
    "shapes": ({"v": V[:, 1:]}, "u and v must be \\[T, Y, X\\]"),
    "transposed": ({"u": U.T, "v": V.T}, "u must have the shape \\[3, 7, 9\\] of t, y, x"),
    "unknown": ({"w": V}, "unknown array w"),
    "codes": ({"validity": CODES + 5}, "validity must be 0, 1, 2 or 3"),
    "code shape": ({"validity": CODES[1:]}, "validity must have the shape"),
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


PIVPY = scene.View("pix", "pix", "pix/dt", "pix/dt")


def dataset(
    view: scene.View = PIVPY,
    *,
    time: str = "frame",
    dims: str = "y x t",
    types: bool = True,
    gone: float = 0.0,
    c: Any = None,
) -> Any:
    """In the schema of pivpy: `chc` is the kind of a vector, `gone` stands where there is none.

    Args:
        time: the unit of t, "" = no times.
        c: volume fraction [T, Y, X].
    """
    xarray = pytest.importorskip("xarray")
    # The air of a simulation has a velocity too.
    codes = CODES if c is None else np.where(scene.fraction() < 1, Validity.VALID, CODES)
    lost = ~np.isin(codes, (Validity.VALID, Validity.INTERPOLATED)[: 1 + types])
    arrays = {n: np.where(lost, gone, a) for n, a in zip("uv", view.velocity(), strict=True)}
    chc = np.select([codes == Validity.VALID, codes == Validity.INTERPOLATED], [1, 5], 0)
    chc[codes == Validity.INVALID] = -1
    arrays |= {"chc": chc} if types else {}
    arrays |= {} if c is None else {"c": c}
    x, y = view.axes()
    t = np.arange(3.0)
    if time != "frame":
        t = (0.5 + t) * 2e-3 / scene.SI[time.partition(" ")[0] or "s"]
    units = dict(zip("xyuv", view.units, strict=True)) | {"t": time, "c": "1", "chc": "1"}
    axes = {"x": x, "y": y} | ({"t": t} if time else {})
    return xarray.Dataset(
        {n: (("t", "y", "x"), a, {"units": units[n]}) for n, a in arrays.items()},
        {n: (n, a, {"units": units[n]}) for n, a in axes.items()},
    ).transpose(*dims.split())


def test_a_data_set_of_another_layout_is_refused() -> None:
    data = dataset()
    with pytest.raises(DataFileError, match="got no u"):
        from_dataset(data.rename(u="ux"))
    with pytest.raises(DataFileError, match="u must have the dimensions t, y, x"):
        from_dataset(data.expand_dims("z"))


def basilisk(
    path: Path,
    k: int = 0,
    *,
    view: scene.View = scene.View(up=True),  # noqa: B008 - frozen
    fields: str = "f p u.x u.y",
    whole: float = 1.0,
    outside: str = "inf",
    rows_first: bool = False,
    **style: str,
) -> Path:
    """x is the outer loop; nodata prints as inf.

    Args:
        fields: names of the columns after x and y; u.x, u.y, p, and any other for the fraction.
        whole: the fraction of a full cell.
        rows_first: y is the outer loop.
    """
    title = "# 1:x 2:y " + " ".join(f"{i}:{name}" for i, name in enumerate(fields.split(), 3))
    x, y = view.axes()
    u, v = view.velocity()
    c = scene.fraction()
    lines: list[list[str]] = []
    for i, j in np.ndindex(x.size, y.size) if not rows_first else np.ndindex(y.size, x.size):
        row, column = (i, j) if rows_first else (y.size - 1 - j, i)
        place = k, row, column
        values = {"u.x": u[place], "u.y": v[place], "p": 2.5}
        cells = scene.text(*(values.get(name, whole * c[place]) for name in fields.split()))
        cells = cells if c[place] > 0 else [outside] * len(cells)
        lines.append(scene.text(x[column], y[row]) + cells)
    return scene.write_table(path, [title], [], lines, **{"delimiter": " ", **style})
