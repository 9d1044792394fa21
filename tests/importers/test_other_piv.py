"""OpenPIV, TSI Insight and DaVis: real samples, and the scene in their layouts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.convert import main
from granpinn.data import FlowFileWarning
from granpinn.importers import DataFileError, Validity, read_vectors
from granpinn.importers.vectors import warn_of_zeros
from tests.importers import scene

SAMPLES = Path(__file__).parent / "samples"


def openpiv(path: Path, k: int = 0, y_up: bool = False) -> Path:
    """`openpiv.tools.save`: masked vectors are written as 0.0."""
    lines = ["# x\ty\tu\tv\tflags\tmask"]
    flags = {Validity.INVALID: 1, Validity.INTERPOLATED: 2}
    for x, y, u, v, code in scene.table(k):
        mask = code == Validity.MASKED
        row = [x, 100 - y if y_up else y, u, -v if y_up else v]
        row = [*row[:2], 0.0, 0.0] if mask else row
        lines.append("\t".join(f"{c:.10e}" for c in (*row, flags.get(code, 0), mask)))
    return scene.write_lines(path, lines)


def insight(path: Path, k: int = 0, unit: str = "pixel") -> Path:
    """Rejected vectors keep their numbers; rows from the top, y up."""
    head = (
        f'TITLE="a.vec" VARIABLES="X mm", "Y mm", "U {unit}", "V {unit}", "CHC", DATASETAUXDATA '
        'Application="PIV" DATASETAUXDATA MicrosecondsPerDeltaT="2000.000000" DATASETAUXDATA '
        'TimeUnit="deltaT" ZONE I=9, J=7, F=POINT'
    )
    code_of = {0: -2, Validity.VALID: 1, Validity.INTERPOLATED: 2, Validity.INVALID: -1}
    rows = [
        f"{x:.6f}, {100 - y:.6f}, {u:.8f}, {-v:.8f}, {code_of[int(code)]}"
        for x, y, u, v, code in scene.table(k)
    ]
    return scene.write_lines(path, [head, *rows])


def davis(path: Path, k: int = 0, comma: bool = True, unit: str = "m/s") -> Path:
    """No vector is exactly (0, 0)."""
    lines = [f'#DaVis 8.1.6 2D-vector 32 9 7 "position" "mm" "position" "mm" "velocity" "{unit}"']
    for x, y, u, v, code in scene.table(k):
        gone = code in (Validity.MASKED, Validity.INVALID)
        cells = [f"{x:.9g}", f"{100 - y:.9g}"] + (
            ["0", "-0"] if gone else [f"{u:.9g}", f"{-v:.9g}"]
        )
        line = "\t".join(cells)
        lines.append(line.replace(".", ",") if comma else line)
    return scene.write_lines(path, lines)


@pytest.mark.parametrize("y_up", [False, True])
def test_openpiv(tmp_path: Path, y_up: bool) -> None:
    files = [openpiv(tmp_path / f"{k}.txt", k, y_up) for k in range(scene.FRAMES)]
    fields = read_vectors(files)
    scene.check(fields)
    assert fields.y_down is not y_up
    assert fields.length_unit is None


def test_openpiv_samples() -> None:
    new = read_vectors(SAMPLES / "openpiv_6col_flags_mask_interTest.txt")
    assert (new.count(Validity.VALID), new.count(Validity.INVALID)) == (565, 715)
    assert new.u.shape == (1, 32, 40)
    assert new.y_down is False
    # Line 7 of the file is the sixth vector of the uppermost row.
    assert (new.u[0, -1, 5], new.v[0, -1, 5]) == (-2.6715e-09, -8.2549e02)
    old = read_vectors(SAMPLES / "openpiv_5col_exp1_001_b.txt")
    assert old.count(Validity.VALID) == old.u.size == 660
    assert old.y_down is True
    assert (old.x[1], old.y[0], old.u[0, 0, 1], old.v[0, 0, 1]) == (32, 16, -0.2141, 5.3176)


def test_insight(tmp_path: Path) -> None:
    """A "pixel" is one per DeltaT, here 2 ms; the masked and the rejected are both invalid."""
    fields = read_vectors([insight(tmp_path / f"a{k}.vec", k) for k in range(scene.FRAMES)])
    expected = scene.codes()[:, ::-1]
    expected[expected == Validity.MASKED] = Validity.INVALID
    np.testing.assert_array_equal(fields.validity, expected)
    there = fields.validity != Validity.INVALID
    np.testing.assert_allclose(fields.u[there], scene.velocity()[0][:, ::-1][there] / 2e-3, 1e-6)
    assert np.isnan(fields.v[~there]).all()
    assert (fields.velocity_unit, fields.length_unit) == ("px/s", "mm")
    metric = read_vectors(insight(tmp_path / "m.vec", unit="m/s"))
    assert metric.velocity_unit == "m/s"


def test_insight_sample() -> None:
    fields = read_vectors(SAMPLES / "insight_day2a005000.vec")
    assert fields.u.shape == (1, 43, 41)
    assert (fields.count(Validity.VALID), fields.count(Validity.INVALID)) == (1500, 263)
    assert fields.u[0, -1, 9] == pytest.approx(-0.043177 / 0.055)
    assert fields.v[0, -1, 9] == pytest.approx(0.257086 / 0.055)
    assert np.isnan(fields.u[0, -1, 0])


@pytest.mark.parametrize("comma", [True, False])
def test_davis(tmp_path: Path, comma: bool) -> None:
    fields = read_vectors([davis(tmp_path / f"B{k}.txt", k, comma) for k in range(scene.FRAMES)])
    scene.check(fields, types=False)
    assert (fields.length_unit, fields.velocity_unit, fields.y_down) == ("mm", "m/s", False)


def test_davis_sample() -> None:
    """2530 of its 4096 places hold (0, -0): none of them may become a vector at rest."""
    fields = read_vectors(SAMPLES / "davis8_ascii_B00001.txt")
    assert fields.u.shape == (1, 64, 64)
    assert fields.count(Validity.VALID) == 4096 - 2530
    assert not ((fields.u == 0) & (fields.v == 0)).any()
    assert fields.y[-1] == pytest.approx(32.4113)


def test_samples_have_no_silent_zeros() -> None:
    for path in sorted(SAMPLES.iterdir()):
        if path.suffix in (".txt", ".vec"):
            fields = read_vectors(path)
            assert not (fields.usable & (fields.u == 0) & (fields.v == 0)).any(), path


def test_many_zeros_are_warned_of(tmp_path: Path) -> None:
    """A mask that was lost leaves zeros behind."""
    path = openpiv(tmp_path / "a.txt")
    lines = [line[:-16] + "0.0000000000e+00" for line in path.read_text().splitlines()[1:]]
    fields = read_vectors(scene.write_lines(path, ["# x\ty\tu\tv\tflags\tmask", *lines]))
    with pytest.warns(FlowFileWarning, match="are exactly zero: grains at rest are seldom"):
        warn_of_zeros(fields)


WRONG: dict[str, tuple[Any, Any, str]] = {
    "openpiv flags": (
        openpiv,
        lambda s: s.replace("e-01	0.0000000000e+00", "e-01	9"),
        "must have flags 0, 1 or 2 and a mask of 0 and 1, got 9",
    ),
    "openpiv cut": (openpiv, lambda s: s[: len(s) // 2], "expected 6 cells|full grid"),
    "openpiv header alone": (openpiv, lambda s: s.split("\n")[0], "no rows of numbers"),
    "insight cut": (
        insight,
        lambda s: s[: len(s) // 2],
        "9 x 7 vectors as its ZONE says|expected 5 cells",
    ),
    "insight names": (
        insight,
        lambda s: s.replace('"U pixel"', '"Q"'),
        "must have the columns u, got x, y, q, v, chc",
    ),
    "davis cut": (davis, lambda s: "\n".join(s.split("\n")[:30]), "63 rows of x, y, u, v"),
    "davis head": (davis, lambda s: s.replace("2D-vector", "image"), "must begin with '#DaVis"),
}


@pytest.mark.parametrize(("write", "change", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_input_is_refused(tmp_path: Path, write: Any, change: Any, message: str) -> None:
    path = write(tmp_path / ("a.vec" if write is insight else "a.txt"))
    path.write_text(change(path.read_text()))
    with pytest.raises(DataFileError, match=message) as caught:
        read_vectors(path)
    assert "\n" not in str(caught.value)


def test_a_mask_that_is_made_of_gaps_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(davis(tmp_path / f"B{k}.txt", k)) for k in range(scene.FRAMES)]
    material = ["--grain-diameter", "2 mm", "--grain-density", "2500 kg/m^3"]
    more = ["--solid-fraction", "0.6", "--frame-rate", "9 Hz", "--out", str(tmp_path / "f.h5")]
    assert main([*files, *material, *more]) == 0
    assert "the free surface is the edge of the vectors" in capsys.readouterr().out
