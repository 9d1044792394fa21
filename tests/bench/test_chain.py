"""The experiment without a laboratory at a tiny size, with true vectors in the place of the PIV."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.studies.experiment import commands
from bench.studies.experiment import run as experiment
from bench.studies.experiment.commands import ExperimentError, run
from bench.studies.experiment.film import Film
from bench.studies.experiment.losses import table
from bench.studies.units_invariance.run import demonstration
from granpinn.data import read_flow, write_flow
from tests.command.pageless import pageless

WINDOW = 8
INVALID = 7  # every seventh vector
TINY = [
    "--steps",
    "20",
    "--network.widths",
    "16,16",
    "--batch.interior",
    "64",
    "--batch.surface",
    "16",
    "--simulated_pressure.frames",
    "0",
]


def true_vectors(film: Film, out: Path) -> None:
    """What a perfect PIV would write as OpenPIV does: px per pair, y up, zeros where masked."""
    out.mkdir()
    camera, half = film.camera, WINDOW // 2
    columns = np.arange(half, camera.columns - half + 1, half)
    rows = np.arange(half, camera.rows - half + 1, half)[::-1]
    x, y = (a.ravel().astype(float) for a in np.meshgrid(columns, rows))
    for k, t in enumerate(film.times):
        u, v = film.field.velocity(t, x * camera.pixel, y * camera.pixel)
        masked = film.field.fraction(t, x * camera.pixel, y * camera.pixel) < 0.5
        flags = np.arange(x.size) % INVALID == 0
        u, v = (np.where(masked, 0, a * film.delay / camera.pixel) for a in (u, v))
        u[flags] = 9.9  # replaced by anything: it must not be used
        np.savetxt(
            out / f"field_A{k:04d}.txt",
            np.stack([x, y, u, v, flags, masked], axis=1),
            fmt="%.4e",
            delimiter="\t",
            header="x\ty\tu\tv\tflags\tmask",
        )


def test_true_vectors_lose_nothing(tmp_path: Path) -> None:
    """Rounding to five digits is all that happens to them; the line is off by a pixel or so."""
    arguments = experiment.parser().parse_args(
        [
            *("--out", str(tmp_path), "--cells", "64", "--pairs", "4", "--pixel", "0.4"),
            *("--window", str(WINDOW), "--measure-only"),
        ]
    )
    found = experiment.experiment(arguments, [], true_vectors)
    assert found == json.loads((tmp_path / "experiment.json").read_text())
    piv, conversion = found["piv"], found["conversion"]
    assert piv["relative_l2_percent"] < 0.01
    assert piv["outliers_percent"] == 0
    assert piv["rejected_percent"] == pytest.approx(100 / INVALID, abs=2)
    assert 0.01 < piv["window_mean_percent"] < 20
    assert conversion["relative_l2_percent"] < 0.01
    assert conversion["slope_of_velocity"] == pytest.approx(1, abs=1e-4)
    assert conversion["time_error_s"] < 1e-9
    # Corners are rounded by the radius of the mean, 4 px: 1.6 % of the height.
    assert conversion["surface"]["rms_percent_of_height"] < 1.6
    assert abs(conversion["surface"]["bias_percent_of_height"]) < 0.8
    flow = read_flow(tmp_path / "measured.h5")
    assert (flow.length_unit, flow.time_unit) == ("m", "s")
    assert flow.truth is None
    assert "surface line" in table(found)


def test_a_flow_of_an_earlier_run_is_identified_and_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "run", lambda command: run(pageless(command)))
    write_flow(demonstration(every=20), tmp_path / "flow.h5")
    arguments = experiment.parser().parse_args(
        ["--out", str(tmp_path / "out"), "--flow", str(tmp_path / "flow.h5")]
    )
    result = experiment.experiment(arguments, TINY)
    assert result == json.loads((tmp_path / "out" / "experiment.json").read_text())
    assert list(result["identification"]) == ["measured"]
    assert not (tmp_path / "out" / "pictures").exists()
    found = result["identification"]["measured"]
    assert found["steps"] == 20
    value = found["parameters"]["mu_s"]["value"]
    assert found["error_percent"]["mu_s"] == pytest.approx(100 * (value / 0.4 - 1))
    assert 0 < found["misfit_percent"] < 100
    assert set(found["truth_in_interval_90"]) == {"mu_s", "mu_2"}
    rows = {"identification": {"measured": found}}
    assert f"mu_s {value:.4f}" in table(rows)


def test_without_openpiv(tmp_path: Path) -> None:
    without = tmp_path / "python"
    without.write_text("#!/bin/sh\nexit 1\n")
    without.chmod(0o755)
    for python in (without, tmp_path / "missing"):
        with pytest.raises(ExperimentError, match="python must have OpenPIV|missing must have"):
            experiment.openpiv(str(python), 16)


def test_a_failing_command_is_named() -> None:
    with pytest.raises(ExperimentError, match="ended with 3: the last line"):
        run(["/bin/sh", "-c", "echo first >&2; echo the last line >&2; exit 3"])
