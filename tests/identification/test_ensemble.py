"""Members of one batch: each trains as it would alone, also beside a member that diverges."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
import torch

from granpinn import identify, identify_many, results
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.fit.case import pose
from granpinn.identification.start import start
from granpinn.kernels.builds import choose_device
from granpinn.progress import Progress
from granpinn.results import Result
from granpinn.training.history import Row
from granpinn.training.loop import TrainingLoop
from tests.flows import make_flow
from tests.runs import tiny

CONFIG = tiny()


def numbers(result: Result) -> tuple[object, ...]:
    """All that an identification found out."""
    return result.parameters, result.error_percent, result.residuals, result.law


@pytest.fixture(scope="module")
def other() -> Flow:
    """Another flow: fewer frames, a lower velocity."""
    return cut(make_flow(), 9)


def cut(flow: Flow, frames: int) -> Flow:
    assert flow.surface is not None
    early = flow.surface.t <= flow.t[frames - 1]
    surface = {f.name: getattr(flow.surface, f.name) for f in dataclasses.fields(flow.surface)}
    cut_surface = {k: None if v is None else v[early] for k, v in surface.items()}
    return dataclasses.replace(
        flow,
        t=flow.t[:frames],
        u=flow.u[:frames] * 0.8,
        v=flow.v[:frames] * 0.8,
        c=flow.c[:frames],
        p=None,
        surface=dataclasses.replace(flow.surface, **cut_surface),
    )


def test_a_member_has_the_bits_of_a_single_run(flow: Flow, other: Flow) -> None:
    flows, seeds, I0 = [flow, other, flow], [3, 1, 2], [0.3, 0.3, 0.2]
    together = identify_many(flows, CONFIG, seeds, I0=I0)
    for found, one, seed, value in zip(together, flows, seeds, I0, strict=True):
        alone = identify(one, dataclasses.replace(CONFIG, seed=seed, I0=value))
        assert numbers(found) == numbers(alone)
        assert (found.seed, found.parameters.I0.value) == (seed, value)
    assert len({found.parameters.mu_s.value for found in together}) == 3


def test_the_folder_of_a_member_is_that_of_a_run(flow: Flow, tmp_path: Path) -> None:
    class Listener(Progress):
        rows: list[Row] = []  # noqa: RUF012

        def show(self, row: Row) -> None:
            self.rows.append(row)

    listener = Listener()
    found = identify_many([flow] * 3, CONFIG, [0, 1, 2], run_dir=tmp_path, progress=listener)
    assert {p.name for p in tmp_path.iterdir()} == {
        "config.toml",
        "checkpoint",
        ".lock",
        "000",
        "001",
        "002",
    }
    for e, result in enumerate(found):
        folder = tmp_path / f"{e:03d}"
        names = {"results.json", "fields.h5", "history.csv", "config.toml"}
        names |= {"network.safetensors"}
        assert {p.name for p in folder.iterdir()} == names
        assert results.read_results(folder / "results.json").parameters == result.parameters
        last = (folder / "history.csv").read_text().splitlines()[-1].split(",")
        assert int(last[0]) == 40
    values = sorted(float((tmp_path / f"{e:03d}/history.csv").read_text().splitlines()[-1]
                          .split(",")[8]) for e in range(3))  # fmt: skip
    assert listener.rows[-1]["mu_s"] == values[1]
    with pytest.raises(ConfigError, match="resume"):
        identify_many([flow] * 3, CONFIG, [0, 1, 2], run_dir=tmp_path)


def test_a_batch_can_be_resumed(flow: Flow, tmp_path: Path) -> None:
    whole = identify_many([flow] * 2, CONFIG, [0, 1])
    first = identify_many([flow] * 2, CONFIG, [0, 1], run_dir=tmp_path)
    again = dataclasses.replace(CONFIG, resume=True)
    resumed = identify_many([flow] * 2, again, [0, 1], run_dir=tmp_path)
    assert [numbers(r) for r in resumed] == [numbers(r) for r in first]
    assert [numbers(r) for r in first] == [numbers(r) for r in whole]


def make_run(flow: Flow, members: int) -> TrainingLoop:
    config = tiny()
    case = pose(flow, config)
    cases = [
        dataclasses.replace(case, member=dataclasses.replace(case.member, seed=seed))
        for seed in range(members)
    ]
    return start(cases, config, None, None, 0.0, choose_device("cpu"), [None] * members)


def spoil(run: TrainingLoop, member: int, steps: set[int]) -> None:
    """Make the loss of a member NaN in some steps."""
    objective = run.trainer.objective
    real = objective.evaluate

    def evaluate(control, params, theta, prefit):  # type: ignore[no-untyped-def]
        e = real(control, params, theta, prefit)
        if int(control.counter[0]) in steps:
            e.loss[member] = math.nan
        return e

    objective.evaluate = evaluate  # type: ignore[method-assign]


def test_a_member_that_diverges_once_goes_on_more_slowly(flow: Flow) -> None:
    run, clean = make_run(flow, 3), make_run(flow, 3)
    spoil(run, 1, {23})
    messages: list[str] = []
    run.progress.message = messages.append  # type: ignore[method-assign]
    run.train()
    clean.train()
    assert run.trainer.lr_scale == [1.0, 0.5, 1.0]
    assert not run.trainer.diverged
    assert len(messages) == 1
    assert "loss became NaN or infinite in step 24: members 1 back to step 20" in messages[0]
    for e in (0, 2):
        assert torch.equal(run.trainer.params[e], clean.trainer.params[e])
    assert not torch.equal(run.trainer.params[1], clean.trainer.params[1])
    assert [row["step"] for row in run.histories[1].rows] == list(range(5, 41, 5))


def test_a_member_that_diverges_twice_is_given_up_alone(flow: Flow) -> None:
    run, clean = make_run(flow, 3), make_run(flow, 3)
    spoil(run, 1, {23, 27})
    run.train()
    clean.train()
    assert run.trainer.diverged.keys() == {1}
    assert "again, after a rollback" in run.trainer.diverged[1]
    for e in (0, 2):
        assert torch.equal(run.trainer.params[e], clean.trainer.params[e])
    assert run.trainer.params.isfinite().all()
