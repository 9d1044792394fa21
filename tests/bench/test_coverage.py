"""The coverage study: its materials, its controls, and a table that is fitted to made-up errors."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from bench.studies import raw
from bench.studies.coverage import calibrate, discrepancy, judge, materials
from bench.studies.coverage.judge import Case
from granpinn.config import ConfigError
from granpinn.data import Flow, write_flow
from granpinn.results import Residuals
from granpinn.results.decoding import encode
from granpinn.results.records import Members
from granpinn.simulation import Collapse
from granpinn.uncertainty import calibration, of_law
from granpinn.uncertainty.center import center
from tests.examples import residuals_with

Array = npt.NDArray[np.float64]

SCATTER = np.array([[7.5e-6, -5.4e-5], [-5.4e-5, 5.1e-4]])
OFFSET = np.array([0.006, -0.005])
SPREAD = np.array([[1e-5, 0.0], [0.0, 3e-4]])


def results(name: str) -> list[dict[str, Any]]:
    """The rows of a study of the repository."""
    path = Path(judge.__file__).parent / "results" / name
    return list(json.loads(path.read_text())["rows"])


@pytest.mark.parametrize(
    ("name", "level", "truths", "caught"),
    [
        ("coverage.json", "V1", 90, 6),
        ("coverage_V0.json", "V0", 90, 6),
    ],
)
def test_flows_of_other_laws_are_caught(name: str, level: str, truths: int, caught: int) -> None:
    """The trainings of the study, whose simulated vectors have no noise."""
    table = calibration.of_level(level)
    assert table is not None
    rows = results(name)
    found: dict[bool, list[bool | None]] = {True: [], False: []}
    for row in rows:
        mu = tuple(row["members"][key][0] for key in ("mu_s", "mu_2"))
        verdict = of_law.verdict(mu, Residuals(row["residuals"]), table, noise=0.0)
        found[row["law"] == materials.LAW].append(verdict.follows)
    assert (len(found[False]), found[False].count(False)) == (6, caught)
    assert found[True] == [True] * truths


def test_a_short_training_has_no_smaller_error_where_it_shows_none() -> None:
    usual = ((4e-5, -1e-5), (-1e-5, 9e-4))
    assert discrepancy.at_least(np.zeros((2, 2)), usual) == pytest.approx(np.array(usual))
    raised = np.array(discrepancy.at_least(np.diag([1e-5, 1e-3]), usual))
    np.testing.assert_allclose(raised, np.diag([4e-5, 1e-3]), atol=1e-12)


@pytest.mark.parametrize("level", ["V0", "V1"])
def test_errors_of_mu_s_do_not_fall_as_mu_s_grows(level: str) -> None:
    """Two errors cancel at large mu_s on the cells of the study, and not on finer ones."""
    table = calibration.of_level(level)
    assert table is not None
    for length in table.lengths:
        sizes = [D[0][0] for D in length.discrepancy]
        assert np.all(np.diff(sizes) >= -1e-12 * sizes[0])


def make_cases(count: int, generator: np.random.Generator, K: int = 3) -> list[Case]:
    """Identifications with a common offset, a spread over materials, and a scatter over seeds."""
    cases = []
    for _ in range(count):
        mu_s = generator.uniform(0.2, 0.6)
        mu = np.array([mu_s, mu_s + generator.uniform(0.1, 0.3)])
        common = generator.multivariate_normal(OFFSET, SPREAD)
        z = common + generator.multivariate_normal([0, 0], SCATTER, K)
        found = mu + mu_s * z
        misfit = generator.uniform(0.001, 0.003)
        momentum, constitutive = np.exp(generator.normal(0, 0.2, 2)) * (10 * misfit, 6 * misfit)
        residuals = residuals_with(misfit, momentum=momentum, constitutive=constitutive)
        values = {name: tuple(found[:, k].tolist()) for k, name in enumerate(("mu_s", "mu_2"))}
        members = Members(tuple(range(K)), values, (False,) * K)
        cases.append(Case(materials.LAW, mu, members, residuals, 40_000))
    return cases


def rows_of(cases: list[Case]) -> list[dict[str, Any]]:
    """As bench.studies.coverage.run writes them."""
    return [
        {
            "law": case.law,
            "truth": dict(zip(("mu_s", "mu_2"), case.mu.tolist(), strict=True)),
            "members": encode(case.members),
            "residuals": case.residuals,
            "steps": case.steps,
            "failure": None,
        }
        for case in cases
    ]


def test_the_table_has_what_the_errors_were_made_of(seed: int) -> None:
    cases = make_cases(1500, np.random.default_rng(seed))
    table = calibrate.fit(cases, calibration.load(), "made up")
    np.testing.assert_allclose(table.scatter, SCATTER, rtol=0.1)
    expected = SPREAD + np.outer(OFFSET, OFFSET)
    for mu_s in (0.25, 0.4, 0.55):
        found = np.diag(table.discrepancy_at(mu_s, table.steps))
        np.testing.assert_allclose(found, np.diag(expected), rtol=0.35)
    assert (table.provenance, table.provisional) == ("made up", False)
    assert table.widening == pytest.approx((1, 1), abs=0.15)
    assert table.discrepancy_weight > 100
    ratios = np.array([[*of_law.residual_ratios(c.residuals, table).values()] for c in cases])
    np.testing.assert_allclose(np.median(ratios, axis=0), 1, atol=0.3)
    verdicts = [of_law.verdict((0.4, 0.64), case.residuals, table) for case in cases]
    assert sum(verdict.follows is not True for verdict in verdicts) <= 2


def test_shorter_trainings_get_errors_of_their_own(seed: int) -> None:
    generator = np.random.default_rng(seed)
    table = calibrate.fit(make_cases(300, generator), calibration.load(), "made up")
    # Twice the error in mu_2 / mu_s, none in mu_s.
    cases = []
    for case in make_cases(100, generator):
        z = 2 * (center(case.members)[1] - case.mu[1]) / case.mu[0]
        mu_2 = case.mu[1] + case.mu[0] * (z + generator.normal(0, 0.02, 3))
        values = {"mu_s": (float(case.mu[0]),) * 3, "mu_2": tuple(mu_2.tolist())}
        members = Members((0, 1, 2), values, (False,) * 3)
        cases.append(case._replace(members=members, steps=10_000))
    found = calibrate.shorter(cases, table, "shorter")
    assert (found.steps, found.flows) == (10_000, 100)
    for D, usual in zip(np.array(found.discrepancy), np.array(table.discrepancy), strict=True):
        assert D[0, 0] == pytest.approx(usual[0, 0])  # no error counts as smaller
        assert 1.5 < np.sqrt(D[1, 1] / usual[1, 1]) < 4
    short = dataclasses.replace(table, shorter=(found,))
    covered = np.mean([judge.score(case, short).covered for case in cases], axis=0)
    assert covered[1] >= 0.85


def test_the_score_is_1_for_intervals_from_the_rms_error(seed: int) -> None:
    error = np.random.default_rng(seed).normal(0, 0.02, 400)
    own = 1.645 * np.sqrt(np.mean(error**2))

    def score(half: float) -> float:
        missed = np.maximum(abs(error) - half, 0.0)
        return judge.sharpness(error, np.full(400, half), missed)

    assert score(own) == pytest.approx(1)
    assert score(3 * own) > 2
    assert score(own / 3) > 2


def test_it_covers_90_percent_of_others(seed: int) -> None:
    generator = np.random.default_rng(seed)
    table = calibrate.fit(make_cases(100, generator), calibration.load(), "made up")
    scores = [judge.score(case, table) for case in make_cases(1000, generator)]
    covered = np.mean([score.covered for score in scores], axis=0)
    # The quantile of 100 truths is itself off by 3 % (one sd).
    assert covered == pytest.approx(0.9, abs=0.1)


def test_heavy_tails_widen_the_intervals(seed: int) -> None:
    generator = np.random.default_rng(seed)

    def heavy(count: int) -> list[Case]:
        cases = make_cases(count, generator)
        grown = []
        for case in cases:
            factor = 8.0 if generator.uniform() < 0.25 else 1.0
            mu = np.array(center(case.members))
            grown.append(case._replace(mu=mu + (case.mu - mu) * factor))
        return grown

    table = calibrate.fit(heavy(200), calibration.load(), "made up")
    covered = [judge.score(case, table).covered for case in heavy(1000)]
    assert np.mean(covered, axis=0) == pytest.approx(0.9, abs=0.08)


def test_a_table_needs_truths() -> None:
    with pytest.raises(ValueError, match="at least 4 truths, got 3"):
        calibrate.fit(make_cases(3, np.random.default_rng(0)), calibration.load(), "made up")


def test_the_command_writes_a_table_that_can_be_loaded(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = make_cases(60, np.random.default_rng(seed))
    other = cases[0]._replace(law="viscous", residuals=Residuals(
        cases[0].residuals, constitutive=1.0))  # fmt: skip
    study = {
        "date": "2026-01-01",
        "simulation": {"cells": 256},
        "members": 3,
        "steps": 40_000,
        "settings": [],
        "rows": [*rows_of([*cases, other]), {"law": materials.LAW, "failure": "diverged"}],
    }
    (tmp_path / "study.json").write_text(json.dumps(study))
    out = tmp_path / "table.json"
    monkeypatch.setattr("sys.argv", ["x", str(tmp_path / "study.json"), "--write", str(out)])
    assert calibrate.main() == 0
    printed = capsys.readouterr().out
    assert "60 truths" in printed
    assert "viscous: 0 follow mu(I), 1 contradict it, 0 cannot be told" in printed
    table = calibration.load(out)
    assert "60 simulated collapses: 2026-01-01, 256 cells, 3 members, 40000" in table.provenance


def test_each_level_has_its_own_table(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = {level: tmp_path / f"{level}.json" for level in ("V0", "V1")}
    for path in shipped.values():
        path.write_text(calibration.PATH.read_text())
    monkeypatch.setattr(calibration, "PATHS", {**shipped, "V2": shipped["V1"]})
    rows = rows_of(make_cases(60, np.random.default_rng(seed)))
    head = {"date": "2026-01-01", "simulation": {"cells": 256}, "members": 1, "steps": 40_000}
    for level in ("V0", "V1"):
        study = head | {"settings": ["--steps", "40000", "--level", level], "rows": rows}
        (tmp_path / f"study_{level}.json").write_text(json.dumps(study))
    files = [str(tmp_path / f"study_{level}.json") for level in ("V0", "V1")]
    monkeypatch.setattr("sys.argv", ["x", files[0], "--write"])
    assert calibrate.main() == 0
    calibration.load.cache_clear()
    assert "--level V0" in calibration.load(shipped["V0"]).provenance
    assert shipped["V1"].read_text() == calibration.PATH.read_text()
    monkeypatch.setattr("sys.argv", ["x", *files, "--write"])
    with pytest.raises(SystemExit):
        calibrate.main()
    assert "the studies must have one level, got V0, V1" in capsys.readouterr().err


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
