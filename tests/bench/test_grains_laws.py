"""The grains study: laws, the momentum balance on an exact flow, scores."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains import flow_file, law, run, score
from bench.studies.grains.coarse import Fields
from bench.studies.grains.materials import (
    BULK_DENSITY,
    BULK_FRACTION,
    FRICTIONS,
    SPHERES,
    Material,
    truth_of,
)
from bench.studies.grains.own_law import own_law, reference
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.surface import fraction, surface_height
from granpinn.data import Flow, read_flow, write_flow
from granpinn.results import Parameter, Parameters
from tests.examples import make_result

LAW = {"mu_s": 0.26, "mu_2": 0.74, "I0": 0.3}
TANGENT = 0.40
HEIGHT = 40.0
CELL = 2.0


def bagnold() -> Fields:
    """Steady flow down a slope: I is the same everywhere, p = rho g cos (h - y), tau = p tan."""
    cos = 1 / math.hypot(1, TANGENT)
    number = law_inverse(TANGENT)
    y = CELL * (np.arange(24) + 0.5)
    x = CELL * (np.arange(12) + 0.5)
    depth = np.maximum(HEIGHT - y, 0)
    u = 2 / 3 * number * math.sqrt(cos) * (HEIGHT**1.5 - depth**1.5)
    p = BULK_DENSITY * cos * depth
    stress = np.stack([p, p, -TANGENT * p], axis=-1)
    phi = np.where(y < HEIGHT, BULK_FRACTION, 0.0)
    frames = np.ones((2, 1, len(x)))
    there = (y < HEIGHT)[:, None] * frames > 0
    return Fields(
        t=np.array([0.0, 1.0]),
        y=y,
        x=x,
        phi=phi[:, None] * frames,
        rho=4 / np.pi * phi[:, None] * frames,
        u=np.where(there, u[:, None] * frames, np.nan),
        v=np.where(there, 0.0, np.nan),
        stress=stress[:, None] * frames[..., None],
        coverage=np.ones((len(y), len(x))),
    )


def law_inverse(mu: float) -> float:
    return LAW["I0"] * (mu - LAW["mu_s"]) / (LAW["mu_2"] - mu)


def bagnold_flow(periodic: bool = True) -> Flow:
    scene = SCENES["chute_fast_steady"](Material(0.4))
    if not periodic:
        scene = replace(scene, attributes={})
    cos = 1 / math.hypot(1, TANGENT)
    scene = replace(scene, gravity=(TANGENT * cos, -cos))
    fields = bagnold()
    height = np.full((2, 12), HEIGHT)
    c = fraction(fields, height)
    return flow_file.flow_of(scene, Material(0.4), fields, c, height, LAW, {"scene": "bagnold"})


def test_the_own_law_of_bagnolds_flow() -> None:
    fields = bagnold()
    height = surface_height(fields)
    np.testing.assert_allclose(height, HEIGHT, atol=CELL / 2)
    c = fraction(fields, height)
    found = reference(fields, c, steady=True, periodic=True)
    k = found.used
    np.testing.assert_allclose(found.tau_n[k] / found.p[k], TANGENT, rtol=1e-6)
    own = own_law(found, LAW)
    assert own["dissipation_ratio"] == pytest.approx(1, abs=0.01)
    assert own["norm"]["mean"]["mu"] == pytest.approx(TANGENT, rel=1e-6)
    assert own["norm"]["law"] is None  # one I
    assert found.noise["velocity_percent"] < 0.1


def test_a_flow_file_of_grains_is_read_back(tmp_path: Path) -> None:
    flow = bagnold_flow()
    write_flow(flow, tmp_path / "flow.h5")
    read = read_flow(tmp_path / "flow.h5")
    assert read.u.dtype == np.float32
    assert read.stated("steady") == 1
    assert read.attributes["window_sd"] == 1
    assert read.truth is not None
    assert (read.truth.mu_s, read.truth.mu_2) == (LAW["mu_s"], LAW["mu_2"])
    assert read.grain_density is None
    partly = (read.c > 0) & (read.c < 1)
    assert partly.any()
    assert np.isfinite(read.u[partly]).all()  # partly filled cells keep their vectors
    assert np.isnan(read.u[read.c == 0]).all()


def test_cropping_keeps_one_empty_cell_around_the_grains() -> None:
    fields = bagnold()
    high = replace(fields, phi=np.where(fields.y[:, None] < 20, fields.phi, 0.0))
    cut = flow_file.cropped(high)
    assert cut.y[-1] == pytest.approx(21)
    assert cut.u.shape == (2, len(cut.y), 12)


def test_the_fit_is_exact_for_the_law() -> None:
    i = np.geomspace(0.003, 0.3, 9)
    found = law.fit(i, law.mu_of_i(LAW, i), np.full(9, 1e-3))
    assert (found["mu_s"], found["mu_2"]) == pytest.approx((0.26, 0.74))
    assert found["mu_s_sd"] > 0
    assert law.errors_percent(partial(law.mu_of_i, found), LAW, 0.02, 0.12) == pytest.approx(
        {"0.03": 0, "0.055": 0, "0.1": 0}, abs=1e-9
    )


def test_bins_average_before_they_divide(seed: int) -> None:
    rng = np.random.default_rng(seed)
    i = np.exp(rng.uniform(np.log(0.004), np.log(0.2), 40_000))
    p = rng.uniform(5, 15, i.size)
    noise = 3 * rng.standard_normal(i.size)
    found = law.binned_law(i, law.mu_of_i(LAW, i) * p + noise, p)
    assert found["law"]["mu_s"] == pytest.approx(0.26, abs=4 * found["law"]["mu_s_sd"])
    assert found["I_range"] == pytest.approx([0.004 * 50**0.05, 0.004 * 50**0.95], rel=0.05)
    assert law.binned_law(np.zeros(9), p[:9], p[:9])["law"] is None


SUMMARY = {
    "scene": "drum",
    "material": 0.4,
    "truth": LAW,
    "own": {
        "along_D": {
            "I_range": [0.02, 0.12],
            "law": LAW,
            "points": [],
            "mean": {"I": 0.06, "mu": 0.34},
        }
    },
}


def test_a_run_is_scored_within_the_range_of_the_scene(tmp_path: Path) -> None:
    values = (0.26 * 1.02, 0.74 * 1.02, 0.3)
    parameters = zip(
        ("mu_s", "mu_2", "I0"),
        (Parameter(v, fixed=k == 2) for k, v in enumerate(values)),
        strict=True,
    )
    result = make_result(parameters=Parameters(parameters))
    found = score.law_score(result, SUMMARY)
    assert found["error_percent_own"] == pytest.approx({"0.03": 2, "0.055": 2, "0.1": 2})
    assert found["mean"]["error_percent"] == pytest.approx(2, abs=1)
    with pytest.raises(ExperimentError, match="scene.json"):
        score.score(tmp_path, tmp_path)


def test_every_score_is_on_the_disk_before_the_next_flow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second scene fails: the score of the first stays."""
    for name in ("chute", "drum"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.json").write_text(json.dumps(SUMMARY))
        write_flow(bagnold_flow(), tmp_path / name / "flow.h5")

    def scored(folder: Path, scene: Path) -> dict[str, Any]:
        if scene.name == "drum":
            raise ExperimentError("no drum")
        return {"scene": scene.name, "material": 0.4, "seed": 7}

    batches: list[int] = []
    monkeypatch.setattr(run, "identify_many", lambda flows, *_, **__: batches.append(len(flows)))
    monkeypatch.setattr(run, "score", scored)
    words = ["--all", str(tmp_path), "--out", str(tmp_path / "runs"), "--group", "1"]
    assert run.main([*words, "--seeds", "7", "--steps", "9"]) == 1
    found = json.loads((tmp_path / "runs" / "grains.json").read_text())
    assert [score["scene"] for score in found["scores"]] == ["chute"]
    assert (found["settings"], batches) == (["--steps", "9"], [1, 1])


def test_a_folder_without_scenes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="got none in"):
        run.scenes_in(tmp_path)
    (tmp_path / "drum").mkdir()
    (tmp_path / "drum" / "flow.h5").touch()
    (tmp_path / "drum" / "scene.json").write_text(json.dumps(SUMMARY))
    assert run.scenes_in(tmp_path) == [tmp_path / "drum"]


def test_every_material_of_the_scenes_has_its_measured_law() -> None:
    for friction in FRICTIONS:
        found = truth_of(Material(friction))
        assert found is not None
        assert 0.2 < found["mu_s"] < 0.3 < 0.7 < found["mu_2"]
    spheres = truth_of(Material(0.4), shape=SPHERES)
    assert spheres is not None
    assert spheres["mu_s"] == pytest.approx(0.341, abs=1e-3)
    assert truth_of(Material(0.9)) is None
