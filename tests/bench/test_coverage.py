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
from granpinn.data import Flow, write_flow
from granpinn.results.records import Members
from granpinn.simulation import Collapse
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


def most_likely(rows: list[Row]) -> np.ndarray:
    return likelihood.most_likely(likelihood.data_of(rows))


def test_the_fit_finds_the_model_that_made_the_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = [*drawn(3000, rng), *drawn(300, rng, real=True)]
    found = fit.model_of(most_likely(rows), rows, "made up", error_model.load())
    ratio = np.array([found.sd(row.known) / TRUE.sd(row.known) for row in rows])
    assert np.quantile(np.abs(np.log(ratio)), 0.95, axis=0) == pytest.approx([0, 0], abs=0.2)
    for own, true in ((found.lower, TRUE.lower), (found.upper, TRUE.upper)):
        for name in ("outline", "noise", "misfit", "law", "steps", "reach"):
            assert own[name] == pytest.approx(true[name], abs=0.25), name
    assert found.correlation == pytest.approx(-0.3, abs=0.06)
    assert (found.level, found.tilt) == pytest.approx((0.02, 0.03), rel=0.25)
    assert found.provenance == "made up"


def test_a_model_covers_flows_that_it_has_not_seen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = drawn(800, rng)
    found = fit.model_of(most_likely(rows), rows, "", error_model.load())
    judged = [fit.judged(row, found) for row in drawn(1500, rng)]
    inside = np.mean([j.pull <= 1 for j in judged], axis=0)
    held = np.mean([j.missed == 0 for j in judged], axis=0)
    assert [*inside, *held] == pytest.approx([0.9] * 4, abs=0.05)


def test_grains_with_one_friction_are_judged_there() -> None:
    (row,) = drawn(1, np.random.default_rng(0), real=True)
    chute = row._replace(true_range=(0.015, 0.015), truth=(0.45, 0.45))
    (x,) = likelihood.places_of(chute)
    assert x == pytest.approx(0.015 / 0.315)
    weights = likelihood.weights_at(chute, np.array([x]))
    middle = line(chute.known.x)[:, 1]
    share = (x - middle[0]) / (middle[1] - middle[0])
    mu = chute.known.ends * [1 - share, share]
    np.testing.assert_allclose(weights, [mu / mu.sum()])
    assert likelihood.errors_at(chute, np.array([x])) == pytest.approx(np.log(mu.sum() / 0.45))
    alone, both = (likelihood.data_of([r]) for r in (chute, row))
    assert (alone.spread, both.spread) == (np.array([1.0]), np.array([0.0]))
    p = likelihood.most_likely(both)
    assert np.isfinite([likelihood.unlikely(p, alone), likelihood.unlikely(p, both)]).all()


def test_constants_are_raised_until_every_population_is_held() -> None:
    """85 % of the rows of the worst population, at either end."""
    better = [np.array([0.1, 0.4])] * 50
    worse = [np.array([1.2, 0.5])] * 15 + [np.array([0.3, 0.5])] * 35
    assert fit.raised([better, worse]) == pytest.approx([1.2, 0.5])
    wider = fit.with_constants(TRUE, np.array([2.0, 1.0]))
    (row,) = drawn(1, np.random.default_rng(0))
    assert wider.sd(row.known) / TRUE.sd(row.known) == pytest.approx([2.0, 1.0], rel=0.02)


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


def test_a_family_that_was_left_out_is_held(stored: list[Row]) -> None:
    """512 cells: no flow of such a simulation is in the fit."""
    left = [row for row in stored if row.family == "512"]
    others = [row for row in stored if row.family != "512"]
    found = fit.model_of(most_likely(others), others, "", error_model.load())
    judged = [fit.judged(row, found) for row in left]
    assert len(judged) >= ENOUGH
    assert np.all(np.mean([j.pull <= 1 for j in judged], axis=0) >= 0.85)
    error, half, missed = (
        np.array([getattr(j, n) for j in judged]) for n in ("error", "half", "missed")
    )
    assert np.all(fit.sharpness(error, half, missed) <= 1.3)


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


def test_the_score_is_1_for_intervals_from_the_rms_error(seed: int) -> None:
    error = np.random.default_rng(seed).normal(0, 0.02, 400)
    own = 1.645 * np.sqrt(np.mean(error**2))

    def score(half: float) -> float:
        missed = np.maximum(abs(error) - half, 0.0)
        return float(fit.sharpness(error, np.full(400, half), missed))

    assert score(own) == pytest.approx(1)
    assert score(3 * own) > 2
    assert score(own / 3) > 2


def test_the_materials_are_a_function_of_the_seed() -> None:
    few, many = (materials.draw(n, 1, 5, cells=64) for n in (2, 4))
    assert few[:2] == many[:2]
    assert few[2:] == many[4:]
    assert [task.law for task in few] == [materials.LAW] * 2 + [
        "viscous",
        "cohesive",
        "reversed",
        "silo",
    ]
    for task in many:
        assert 0.2 <= task.scene.mu_s <= 0.6
        assert 0.1 <= task.scene.mu_2 - task.scene.mu_s <= 0.3
    viscous = few[2].scene
    assert viscous.eta_min == pytest.approx(viscous.eta_max, rel=1e-5)
    assert few[3].scene.cohesion >= 0.5


def test_a_flow_is_read_as_an_experiment_would_give_it(flow: Flow, tmp_path: Path) -> None:
    write_flow(flow, tmp_path / "flow.h5")
    forward, back = (
        materials.read(materials.Task("x", law, Collapse()), tmp_path / "flow.h5")
        for law in (materials.LAW, "reversed")
    )
    assert (forward.eta_min, forward.eta_max) == (None, None)
    np.testing.assert_array_equal(back.u, -forward.u[::-1])
    np.testing.assert_array_equal(back.c, forward.c[::-1])
    assert back.surface is not None
    assert forward.surface is not None
    np.testing.assert_allclose(np.unique(back.surface.t), np.unique(forward.surface.t), rtol=1e-12)


def test_settings_go_to_the_identification() -> None:
    words = ["--steps", "200", "--network.widths", "8,8", "--log-every", "7"]
    values = raw.settings_of(words)
    assert values == {"steps": 200, "network.widths": (8, 8), "log_every": 7}
    for wrong in (["--stepz", "3"], ["--steps"]):
        with pytest.raises(ConfigError, match="must be a setting of granpinn.train"):
            raw.settings_of(wrong)
