"""A whole run on each device: the work after the training is done on the CPU.

`pytest -k cuda` picks the GPU's; fields and errors are made on the CPU from parameters that lie on
the device.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from granpinn import results
from granpinn.commands import train
from granpinn.data import Flow
from granpinn.fit.case import members, pose
from granpinn.fit.ensemble import network_of
from granpinn.fit.prediction import predict
from granpinn.fit.scoring import relative_l2
from granpinn.identification.start import start
from granpinn.kernels.builds import choose_device
from tests.runs import tiny

NO_GPU = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")


DEVICES = ["cpu", pytest.param("cuda", marks=NO_GPU)]


TOML = """
steps = 50
log_every = 10
[network]
widths = [9, 7]
[batch]
interior = 33
surface = 6
"""


@pytest.fixture
def settings(tmp_path: Path) -> Path:
    path = tmp_path / "settings.toml"
    path.write_text(TOML)
    return path


@pytest.mark.parametrize("device", DEVICES)
def test_fields_are_those_of_the_cpu(device: str, flow: Flow) -> None:
    config = tiny(device=device, steps=50, members=2)
    cases = members(pose(flow, config))
    run = start(
        cases, config, None, None, time.monotonic(), choose_device(config.device), [None] * 2
    )
    run.train()
    for e, case in enumerate(cases):
        params, theta = run.trainer.solution(e)
        assert params.device.type == theta.device.type == device
        there = network_of(case, run.trainer, e)
        here = dataclasses.replace(there, params=params.cpu(), theta=theta.cpu())
        maps, same = predict(flow, there), predict(flow, here)
        for name in ("u", "v", "p", "tau_xx", "tau_xy", "D2", "I", "eta"):
            error = relative_l2(maps.values[name], same.values[name])
            assert error is not None
            assert error < 1e-2, name  # in %: hundreds of roundings of float32


@pytest.mark.parametrize("device", DEVICES)
def test_the_command_leaves_everything(
    device: str,
    flow_file: Path,
    settings: Path,
    tmp_path: Path,
    figures: Callable[..., None],
) -> None:
    figures("velocity")
    out = tmp_path / "run"
    argv = [flow_file, "--out", out, "--device", device, "--members", 2, "--config", settings]
    assert train.main([str(a) for a in argv]) == 0
    result = results.read_results(out / "results.json")
    assert torch.device(result.device).type == device
    assert result.failure is None
    assert result.members is not None
    assert len(result.members.seed) == 2
    for name in ("velocity", "pressure"):
        assert np.isfinite(getattr(result.error_percent, name))
    assert (out / "report.html").stat().st_size > 10_000
