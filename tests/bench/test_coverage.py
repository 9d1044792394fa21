"""The coverage study: its materials, its controls, and an error model fitted to made-up errors."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from bench.studies import raw
from bench.studies.coverage import fit, likelihood, materials, table
from bench.studies.coverage.table import GRAINS, Row
from granpinn.config import ConfigError
from granpinn.results.records import Members
from granpinn.uncertainty import error_model
from granpinn.uncertainty.error_model import ErrorModel, Known, line

TRUE = dataclasses.replace(
    error_model.load(),
    freedom=likelihood.FREEDOM,
    lower={"constant": -7.0, "outline": 0.6, "noise": 0.5, "misfit": 0.4, "law": 0.5, "steps": 0.0}
    | {"reach": -0.2, "contrast": 1.0},
    upper={"constant": -6.6, "outline": 0.8, "noise": 0.1, "misfit": 0.9, "law": 0.3, "steps": 0.5}
    | {"reach": -0.8, "contrast": 2.0},
    correlation=-0.3,
    common=0.4,
    level=0.02,
    tilt=0.03,
    tested=dict.fromkeys(error_model.WORDS, (1e-9, 1e3)),
)
ENOUGH = 40  # rows of a population, for a statement on how many are held


def drawn(count: int, rng: np.random.Generator, real: bool = False) -> list[Row]:
    """Identifications with errors from the model TRUE."""
    rows = []
    for k in range(count):
        x = float(rng.uniform(0.002, 0.03)), float(rng.uniform(0.08, 0.5))
        mu_s = rng.uniform(0.2, 0.6)
        truth = float(mu_s), float(mu_s + rng.uniform(0.1, 0.3))
        noise = float(np.exp(rng.uniform(*np.log((0.01, 0.6)))))
        misfit = float(np.hypot(noise, np.exp(rng.uniform(*np.log((0.002, 0.05))))))
        known = Known(x, truth, misfit, float(np.exp(rng.uniform(*np.log((0.002, 0.06))))), noise)
        steps = int(rng.choice([2000, 6000, 15_000]))
        known = known._replace(vectors=20_000.0, steps=steps, outline=bool(k % 2), real=real)
        C = TRUE.method(known) + TRUE.grains(known)
        e = rng.multivariate_normal([0, 0], C) / np.sqrt(rng.chisquare(TRUE.freedom) / TRUE.freedom)
        mu = np.linalg.solve(line(x), (line(x) @ truth) * np.exp(e)).tolist()
        members = Members((0,), {"mu_s": (mu[0],), "mu_2": (mu[1],)})
        known = known._replace(mu=(mu[0], mu[1]))
        population = GRAINS if real else f"made-{k % 4}"
        family = f"scene-{k % 8}" if real else population
        rows.append(Row(population, f"flow-{k}", family, known, members, truth, 0.3, None))
    return rows


@pytest.fixture(scope="module")
def stored() -> list[Row]:
    return table.read()


def test_the_shipped_model_holds_the_stored_flows(stored: list[Row]) -> None:
    """Of populations of enough flows; the study reports those that a fit has not seen."""
    model = error_model.load()
    for name in dict.fromkeys(row.population for row in stored):
        judged = [fit.judged(row, model) for row in stored if row.population == name]
        if len(judged) < ENOUGH:
            continue
        inside = np.mean([j.pull <= 1 for j in judged], axis=0)
        assert np.all(inside >= 0.8), (name, inside)


def test_the_command_writes_a_model_that_can_be_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(0)
    rows = [*drawn(160, rng), *drawn(16, rng, real=True)]
    monkeypatch.setattr(table, "read", lambda _: rows)
    monkeypatch.setattr(error_model, "PATH", tmp_path / "model.json")
    monkeypatch.setattr(fit, "REPORT", tmp_path / "report.md")
    assert fit.main(["--write"]) == 0
    printed = capsys.readouterr().out
    for population in ("made-0", "made-3", GRAINS):
        assert printed.count(f"\n| {population} ") == 1
    found = error_model.load(tmp_path / "model.json")
    assert isinstance(found, ErrorModel)
    assert (tmp_path / "report.md").read_text() in printed
    assert found.provenance == "bench.studies.coverage.fit of 160 simulated flows and 16 of grains"


def test_raw_rows_make_the_table(tmp_path: Path) -> None:
    """A simulated flow, a control, a scene of grains and one that walls carry; others stay."""
    residuals = {"velocity": 0.2, "noise": 0.1, "momentum": 0.02, "constitutive": 0.01}
    run = {
        "failure": None,
        "level": "V0",
        "steps": 15_000,
        "members": {"mu_s": [0.3, 0.32], "mu_2": [0.5, 0.6]},
        "residuals": residuals | {"continuity": 0.03},
        "data": {"measured_noise": 0.12, "independent": 5e4, "symmetries": [], "slips": []},
        "baseline": None,
    }
    flow = run | {
        "name": "varied-9-0001",
        "law": materials.LAW,
        "truth": {"mu_s": 0.31, "mu_2": 0.52},
        "flow": {"I0": 0.25},
        "I_range": [0.01, 0.2],
    }
    scene = run | {
        "scene": "drum",
        "material": 0.4,
        "level": "V1",
        "law": {"I0": 0.3},
        "own_law": {"mu_s": 0.25, "mu_2": 0.8},
        "mean": {"I": 0.05, "mu": 0.33},
        "I_range": [0.005, 0.1],
        "result_I_range": [0.004, 0.12],
    }
    silo = scene | {"scene": "silo", "baseline": {"carried": True, "points": []}}
    chute = scene | {"scene": "chute", "own_law": None, "level": "V1"}
    (tmp_path / "varied.json").write_text(json.dumps({"rows": [flow, flow | {"law": "viscous"}]}))
    (tmp_path / "grains.json").write_text(json.dumps({"scores": [scene, silo, chute]}))
    out = tmp_path / "rows.csv"
    assert table.main([str(tmp_path / "varied.json"), "--csv", str(out)]) == 0
    assert table.main([str(tmp_path / "grains.json"), "--csv", str(out)]) == 0
    assert len(out.read_text().splitlines()) == 1 + 2 + 3
    simulated, drum, of_chute = table.read(out)
    assert (simulated.population, simulated.family) == ("varied", "varied-9")
    x = tuple(I / (I + 0.25) for I in (0.01, 0.2))
    mu = simulated.known.mu
    assert mu == pytest.approx((0.31, 0.55))
    assert simulated.known == Known(x, mu, 0.2, 0.01, 0.1, 5e4, 15_000, outline=True)
    assert (simulated.truth, simulated.true_range) == ((0.31, 0.52), None)
    assert (drum.population, drum.name, drum.family) == (GRAINS, "drum-0.4", "drum")
    assert (drum.true_range, drum.known.real) == ((0.005, 0.1), True)
    assert (of_chute.truth, of_chute.true_range) == ((0.33, 0.33), (0.05, 0.05))


def test_settings_go_to_the_identification() -> None:
    words = ["--steps", "200", "--network.widths", "8,8", "--log-every", "7"]
    values = raw.settings_of(words)
    assert values == {"steps": 200, "network.widths": (8, 8), "log_every": 7}
    for wrong in (["--stepz", "3"], ["--steps"]):
        with pytest.raises(ConfigError, match="must be a setting of granpinn.train"):
            raw.settings_of(wrong)
