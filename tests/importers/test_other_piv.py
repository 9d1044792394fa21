"""OpenPIV and DaVis: real samples, and the scene in their layouts."""

from __future__ import annotations

from pathlib import Path

import pytest

from granpinn.importers import Validity, read_vectors
from tests.importers import scene

SAMPLES = Path(__file__).parent / "samples"


def openpiv(
    path: Path,
    k: int = 0,
    *,
    view: scene.View = scene.PIXELS,
    gone: str = "0.0",
    delimiter: str = "\t",
    **style: str,
) -> Path:
    """`openpiv.tools.save`: masked vectors are written as 0.0."""
    kinds = {Validity.INVALID: 1, Validity.INTERPOLATED: 2}
    rows = []
    for x, y, u, v, code in scene.table(k, view):
        filled = code != Validity.MASKED
        cells = scene.text(x, y) + (scene.text(u, v) if filled else [gone, gone])
        rows.append(cells + scene.text(kinds.get(code, 0), code == Validity.MASKED))
    names = ["x", "y", "u", "v", "flags", "mask"]
    return scene.write_table(path, [], names, rows, title="# {}", delimiter=delimiter, **style)


PIXEL = {"px": "pixel", "px/frame": "pixel"}

DAVIS = scene.View("mm", "mm", "m/s", "m/s", up=True)


def davis(
    path: Path,
    k: int = 0,
    *,
    view: scene.View = DAVIS,
    decimal: str = ",",
    delimiter: str = "\t",
    gone: str = "0",
) -> Path:
    """No vector is exactly (0, 0)."""
    names = ["position", "position", "velocity", "velocity"][: 4 if view.u != view.v else 3]
    units = [f'"{n}" "{PIXEL.get(u, u)}"' for n, u in zip(names, view.units, strict=False)]
    rows = []
    for x, y, u, v, code in scene.table(k, view):
        filled = code == Validity.VALID
        rows.append(scene.text(x, y) + (scene.text(u, v) if filled else [gone, gone]))
    head = [f"#DaVis 8.1.6 2D-vector 32 9 7 {' '.join(units)}"]
    return scene.write_table(path, head, [], rows, delimiter=delimiter, decimal=decimal)


def test_openpiv_samples() -> None:
    new = read_vectors(SAMPLES / "openpiv_6col_flags_mask_interTest.txt")
    assert [(new.validity == kind).sum() for kind in (Validity.VALID, Validity.INVALID)] == [
        565,
        715,
    ]
    assert new.u.shape == (1, 32, 40)
    assert new.y_down is False
    # Line 7 of the file is the sixth vector of the uppermost row.
    assert (new.u[0, -1, 5], new.v[0, -1, 5]) == (-2.6715e-09, -8.2549e02)


def test_davis_sample() -> None:
    """2530 of its 4096 places hold (0, -0): none of them may become a vector at rest."""
    fields = read_vectors(SAMPLES / "davis8_ascii_B00001.txt")
    assert fields.u.shape == (1, 64, 64)
    assert fields.usable.sum() == 4096 - 2530
    assert not ((fields.u == 0) & (fields.v == 0)).any()
    assert fields.y[-1] == pytest.approx(32.4113)


def test_samples_have_no_silent_zeros() -> None:
    for path in sorted(SAMPLES.iterdir()):
        if path.suffix == ".txt":
            fields = read_vectors(path)
            assert not (fields.usable & (fields.u == 0) & (fields.v == 0)).any(), path
