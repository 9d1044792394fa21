"""The study of non-local grains on made-up scenes whose answers are known."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.studies.grains.law import mu_of_i
from bench.studies.grains.make import FLOW, REFERENCE, SUMMARY
from bench.studies.laws.non_local import run
from bench.studies.laws.non_local.laws import (
    Cells,
    at_one_number,
    cells_of,
    curve,
    judged,
    quantiles,
    reached,
)
from bench.studies.laws.non_local.profiles import creep, profile
from bench.studies.laws.non_local.zones import Zones, cross, jackknife, zones_of
from granpinn.arrays import Float64
from granpinn.data import Flow, Surface, Truth, write_flow

TRUTH = {"mu_s": 0.25, "mu_2": 0.75, "I0": 0.3}
KNOWN = Truth(mu_s=0.25, mu_2=0.75, I0=0.3)
LENGTH, YIELD = 3.0, 16.0  # d
HEIGHT, WIDTH = 40, 64  # d; cells of 2 d


def depth_and_rate(y: Float64) -> tuple[Float64, Float64]:
    """Shear at an exponential rate below a depth, at a constant rate above it."""
    depth = HEIGHT - y
    return depth, 0.02 * np.exp(-np.maximum(depth - YIELD, 0) / LENGTH)


def friction(depth: Float64) -> Float64:
    """Falls through mu_s at the yield depth, in a straight line."""
    return TRUTH["mu_s"] - 0.004 * (depth - YIELD)


@pytest.fixture(scope="module")
def zones(draw: np.random.Generator) -> Zones:
    """Layers that creep below a depth of 16 d, with independent noise in both means."""
    y, x = np.meshgrid(np.arange(1.0, HEIGHT, 2), np.arange(1.0, WIDTH, 2), indexing="ij")
    depth, rate = depth_and_rate(y)
    p = 1.0 * depth
    D, tau = np.zeros((2, *y.shape, 2)), np.zeros((2, *y.shape, 2))
    D[..., 1], tau[..., 1] = rate / 2, friction(depth) * p
    D += 5e-5 * draw.normal(size=D.shape)
    tau += 0.02 * draw.normal(size=tau.shape) * p[..., None]
    whole = np.ones(y.shape, bool)
    tile = 1000 * (y // 8) + x // 8
    return Zones("made", D, tau, np.stack([p, p]), whole, depth, whole, tile, 1.0, TRUTH, True)


@pytest.fixture(scope="module")
def draw() -> np.random.Generator:
    return np.random.default_rng(2027)


@pytest.fixture(scope="module")
def local(draw: np.random.Generator) -> Cells:
    """Cells that obey mu(I), with noise in their stress."""
    n = 4000
    number = np.geomspace(1e-4, 0.2, n)
    p, noise = draw.uniform(1, 3, n), 1 + 0.05 * draw.normal(size=n)
    tau = mu_of_i(TRUTH, number) * p * noise
    depth, tile = draw.uniform(0, 30, n), draw.integers(0, 40, n).astype(float)
    return Cells(number, tau, tau**2, p, number**2, depth, tile, number > 1e-2)


def test_creep_finds_the_length_and_the_constant(zones: Zones) -> None:
    rows = profile(zones)
    found = creep(rows, TRUTH["mu_s"])
    assert found is not None
    assert found["depth"][0] == 17.0  # the first layer below yield
    assert found["depth"][1] <= found["depth"][0] + 10
    assert abs(found["length"] - LENGTH) < 4 * found["length_se"] < 0.4
    mu = friction(np.arange(17.0, 28, 2))
    assert found["A"] == pytest.approx(LENGTH * np.sqrt(0.25 - mu.mean()), rel=0.1)
    for row in rows:
        assert abs(row["mu"] - friction(np.array(row["depth"]))) < 4 * row["mu_se"] + 0.002
    assert rows[0]["shared"] > 0.99 > 0.9 > rows[-1]["shared"]


def test_there_is_no_creep_where_all_flows_above_yield(zones: Zones) -> None:
    rows = profile(zones)
    assert creep(rows, 0.1) is None  # all layers are above this yield
    assert creep(rows[:10], TRUTH["mu_s"]) is None  # two layers below it


def test_noise_cancels_between_the_means(draw: np.random.Generator) -> None:
    noise = draw.normal(size=(2, 20000, 2))
    assert abs(cross(noise).mean()) < 0.05 < (noise**2).mean()
    assert cross(noise + np.array([3.0, 4.0])).mean() == pytest.approx(25, rel=0.01)


def test_jackknife_is_the_standard_error_of_a_mean(draw: np.random.Generator) -> None:
    values, tile = draw.normal(size=900), np.arange(900.0)
    whole, se = jackknife(lambda k: values[k].mean(), tile, np.ones(900, bool))
    assert whole == pytest.approx(values.mean())
    assert se == pytest.approx(values.std(ddof=1) / 30, rel=1e-6)


def test_local_grains_give_their_law_and_equal_halves(local: Cells) -> None:
    for row in curve(local):
        assert abs(row["mu"] - mu_of_i(TRUTH, row["I"])) < 4 * row["se"] + 0.002
    found = judged(local, local.weight)
    law = found["mu_of_i"]
    assert law["parameters"] == pytest.approx({"mu_s": 0.25, "mu_2": 0.75}, rel=0.03)
    for half in law["halves"].values():
        assert abs(half["percent"]) < 4 * half["se"]
    rate = found["coulomb"]["halves"]["rate"]  # no constant: the fast half needs more
    assert rate["percent"] > 5 * rate["se"]


def test_creep_pulls_the_laws_down(local: Cells) -> None:
    """A third less friction below I = 1e-3: seen by laws that weight all cells alike."""
    slow = local.number < 1e-3
    creeping = replace(local, tau=local.tau * np.where(slow, 2 / 3, 1))
    weighted = judged(creeping, creeping.weight)["mu_of_i"]
    alike = judged(creeping, np.ones_like(local.weight))
    assert weighted["parameters"]["mu_s"] == pytest.approx(0.25, rel=0.03)
    assert alike["mu_of_i"]["parameters"]["mu_s"] < 0.23
    first = weighted["too_high_percent"][0]
    assert first["I_from"] == 1e-4
    assert abs(first["percent"] - 50) < 4 * first["se"] + 1
    held = reached(creeping, TRUTH)
    assert held["slow_percent"] == pytest.approx(100 * slow.mean())
    assert held["slow_weight_percent"] < 0.1
    assert held["slow_below_mu_s_percent"] > 99
    assert held["I_flowing"][0] >= 1e-2 > held["I_all"][0]


def test_scenes_are_compared_at_one_inertial_number() -> None:
    def points(mu: float) -> list[dict[str, float]]:
        return [{"I": i, "mu": mu, "se": 0.01} for i in (2e-3, 2e-2)]

    rows = at_one_number({"a": points(0.3), "b": points(0.2)}, ("mu", "se"), TRUTH)
    assert [row["I"] for row in rows] == [3e-3, 1e-2]  # nothing beyond the bins
    assert rows[0]["range_percent"] == pytest.approx(40)
    assert rows[0]["chi2_per_degree"] == pytest.approx(50)


def test_quantiles_follow_the_weights() -> None:
    assert quantiles(np.array([3.0, 1, 2]), np.array([1.0, 1, 98]), (0.05, 0.5, 0.999)) == [2, 2, 3]


def scene_in(folder: Path, name: str, truth: Truth | None = KNOWN) -> Path:
    """A chute whose speed settles at t = 100, in files as `make` writes them."""
    made = folder / name
    made.mkdir()
    t, y, x = np.arange(80.0, 130.0), np.arange(1.0, HEIGHT, 2), np.arange(1.0, WIDTH, 2)
    at_t, at_y, _ = np.meshgrid(t, y, x, indexing="ij")
    settled = at_t >= 100
    wave = 1 + 1e-3 * np.sin(at_t)  # frames that repeat each other are refused
    u = (wave * np.where(settled, 0.02 * at_y, 1.0)).astype(np.float32)
    depth = HEIGHT - at_y
    line = np.repeat(t, len(x)), np.tile(x, len(t)), np.full(len(t) * len(x), float(HEIGHT))
    flow = Flow(
        t=t,
        y=y,
        x=x,
        u=u,
        v=0 * u,
        c=np.ones(u.shape, np.float32),
        gravity=(0.3, -0.95),
        density=1.0,
        grain_diameter=1.0,
        surface=Surface(*line),
        truth=truth,
        attributes={"scene": name.partition("-")[0], "period_x": float(WIDTH)},
    )
    write_flow(flow, made / FLOW)
    shear = np.where(settled, -0.3 * depth, 5.0)
    stress = {"sigma_xx": depth, "sigma_yy": depth, "sigma_xy": shear, "p": depth}
    np.savez(made / REFERENCE, used=np.ones(u.shape, bool), **stress)
    (made / SUMMARY).write_text("{}")
    return made


def test_a_scene_is_read_from_its_settled_frames(tmp_path: Path) -> None:
    folder = scene_in(tmp_path, "chute_slow-0.4")
    zones = zones_of(folder)
    assert zones.D[..., 1] == pytest.approx(0.01, rel=1e-3)  # u_y / 2
    assert zones.D[..., 0] == pytest.approx(0, abs=1e-6)
    assert zones.depth[0, 0] == pytest.approx(39)
    assert zones.along / zones.p[0] == pytest.approx(0.3, rel=1e-5)
    assert zones.number[0, 0] == pytest.approx(0.02 / np.sqrt(39), rel=1e-3)
    cells = cells_of(zones, folder)
    assert cells.weight == pytest.approx(1, rel=1e-3)  # one shear rate
    assert cells.square == pytest.approx((0.3 * cells.p) ** 2)


def test_the_study_writes_its_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene_in(tmp_path, "chute_slow-0.4")
    out = tmp_path / "found.json"
    monkeypatch.setattr(sys, "argv", ["run", str(tmp_path), "--json", str(out)])
    assert run.main() == 0
    assert "slow cells   0.0 %" in capsys.readouterr().out
    found = json.loads(out.read_text())["scenes"]["chute_slow-0.4"]
    assert found["creep"] is None
    assert found["laws"]["coulomb"]["parameters"]["mu_s"] == pytest.approx(0.3, rel=1e-3)
    monkeypatch.setattr(sys, "argv", ["run", str(out.parent / "empty"), "--json", str(out)])
    assert run.main() == 1


def test_a_scene_without_a_shear_cell_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene_in(tmp_path, "chute_slow-0.4", truth=None)
    monkeypatch.setattr(sys, "argv", ["run", str(tmp_path), "--json", str(tmp_path / "none")])
    assert run.main() == 1
    assert "must have the law of its shear cell, got none" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
