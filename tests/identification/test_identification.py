"""`granpinn.identify`: the whole chain in memory and on disk, without use of the true values."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from granpinn import results
from granpinn.config import Config, ConfigError
from granpinn.config.toml import read_toml
from granpinn.data import Flow, Truth
from granpinn.fit import case as case_module
from granpinn.fit import prediction
from granpinn.fit.network import TrainedNetwork
from granpinn.identification.identify import identify
from granpinn.kernels.builds import choose_device
from granpinn.training.loop import TrainingLoop
from granpinn.training.time_limit import Limit
from tests.runs import tiny


def test_a_notebook_needs_no_folder(flow: Flow, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    result = identify(flow, tiny())
    assert 0 < result.parameters.mu_s.value < result.parameters.mu_2.value
    assert results.Parameter(0.3, fixed=True) == result.parameters.I0
    assert result.parameters.mu_s.std is None
    assert result.timing.steps == 40
    assert result.stopped == "steps"
    assert result.error_percent.velocity is not None
    assert result.error_percent.mu_s is not None
    assert result.data.noise == 0
    assert (result.level, result.form, result.recipe) == ("V1", "mixed", "default")
    assert result.device == "cpu"
    assert not list(tmp_path.iterdir())


def test_the_run_folder_holds_the_result(flow_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    config = tiny(seed=2)
    result = identify(flow_file, config, run_dir=folder)
    names = {"results.json", "fields.h5", "network.safetensors"}
    names |= {"history.csv", "config.toml", "checkpoint", ".lock"}
    assert {path.name for path in folder.iterdir()} == names
    assert results.read_results(folder / "results.json").parameters == result.parameters
    assert result.input.name == "heap.h5"
    assert len(result.input.sha256) == 64
    assert Config(**read_toml(folder / "config.toml")) == config


@pytest.mark.parametrize("form", ["mixed", "strong"])
@pytest.mark.parametrize("level", ["V0", "V1", "V2"])
def test_every_form_at_every_level(form: str, level: str, flow: Flow) -> None:
    result = identify(flow, tiny(form=form, level=level, steps=3, optimizer__prefit=0.0))
    assert (result.form, result.level) == (form, level)
    assert "momentum_balance" in result.checks
    assert result.data.n_surface > 0


def test_the_paper_recipe_runs(flow: Flow) -> None:
    result = identify(flow, Config(recipe="paper", steps=3, network__widths=(9, 7)))
    assert (result.recipe, result.form, result.level) == ("paper", "strong", "V2")


@pytest.mark.parametrize(
    "blind",
    [
        {"truth": None},
        {"truth": Truth(mu_s=0.1, mu_2=0.9, I0=0.5)},
        {"p": None},
    ],
    ids=["no truth", "other truth", "no reference pressure"],
)
def test_training_sees_no_truth_and_no_reference_pressure(
    blind: dict[str, Any], flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[TrainingLoop] = []
    real = TrainingLoop.train

    def train(run: TrainingLoop) -> None:
        runs.append(run)
        real(run)

    monkeypatch.setattr(TrainingLoop, "train", train)
    identify(flow, tiny())
    identify(dataclasses.replace(flow, **blind), tiny())
    one, other = runs
    assert one.identity == other.identity
    for name, tensor in one.trainer.tensors().items():
        assert torch.equal(tensor, other.trainer.tensors()[name])


def test_noise_is_seen_by_the_training_and_not_by_the_scores(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Flow] = []
    real = case_module.training_set

    def training_set(flow: Flow, *args: Any) -> Any:
        seen.append(flow)
        return real(flow, *args)

    monkeypatch.setattr(case_module, "training_set", training_set)
    references: list[Any] = []
    real_predict = prediction.predict

    def predict(flow: Flow, network: TrainedNetwork) -> Any:
        references.append(flow)
        return real_predict(flow, network)

    monkeypatch.setattr(prediction, "predict", predict)
    result = identify(flow, tiny(noise=0.2, seed=5))
    assert result.data.noise == 0.2
    assert not np.array_equal(seen[0].u[flow.valid], flow.u[flow.valid])
    assert references == [flow]


def test_two_runs_never_mix(flow: Flow, tmp_path: Path) -> None:
    identify(flow, tiny(), run_dir=tmp_path)
    with pytest.raises(ConfigError, match=r"already holds a run \(results.json\): add resume"):
        identify(flow, tiny(), run_dir=tmp_path)
    before = (tmp_path / "config.toml").read_text()
    identify(flow, tiny(resume=True), run_dir=tmp_path)
    assert (tmp_path / "config.toml").read_text() == before


def test_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    def kernels(there: bool) -> None:
        name = "_dispatch_has_kernel_for_dispatch_key"
        monkeypatch.setattr(torch._C, name, lambda op, key: there)

    def gpu(there: bool) -> None:
        monkeypatch.setattr(torch.cuda, "is_available", lambda: there)

    kernels(False)
    gpu(True)
    assert choose_device("auto").type == choose_device("cpu").type == "cpu"
    with pytest.raises(ConfigError, match="device cuda needs the CUDA kernels"):
        choose_device("cuda")
    kernels(True)
    assert choose_device("auto").type == choose_device("cuda").type == "cuda"
    assert choose_device("cpu").type == "cpu"
    gpu(False)
    assert choose_device("auto").type == "cpu"
    with pytest.raises(ConfigError, match="device cuda needs a GPU"):
        choose_device("cuda")


@pytest.mark.parametrize(
    ("checks", "members", "kept"), [("quick", 1, 1.0), ("none", 1, 0.0), ("all", 2, 13.0)]
)
def test_a_time_limit_keeps_time_for_the_checks_that_are_made(
    checks: str, members: int, kept: float, flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[Limit | None] = []

    class Stopped(Exception):
        pass

    def train(run: TrainingLoop) -> None:
        limits.append(run.limit)
        raise Stopped

    monkeypatch.setattr(TrainingLoop, "train", train)
    flow = dataclasses.replace(flow, attributes={"surface_sd": 0.0})  # no time for another line
    begin = time.monotonic()
    with pytest.raises(Stopped):
        identify(flow, tiny(max_time=600.0, checks=checks, members=members), reserve=7.0)
    (limit,) = limits
    assert limit is not None
    assert limit.until == pytest.approx(begin + 593, abs=5)
    assert (limit.seconds, limit.later, limit.after) == (600, 0, kept)
