"""Gate T-1: a run that is interrupted anywhere and resumed has the bits of one that was not."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.errors import Interrupted
from granpinn.training.checkpoint import CheckpointError
from granpinn.training.history import Row
from granpinn.training.loop import TrainingLoop
from tests.flows import make_flow
from tests.runs import make_run, tiny

CONFIGS: dict[str, dict[str, Any]] = {
    "default": {},
    "float64": {"dtype": "float64"},
    "paper": {"recipe": "paper", "network__widths": (9, 7), "batch__interior": 33},
}


def config_of(name: str) -> Config:
    changes = dict(CONFIGS[name])
    if recipe := changes.pop("recipe", None):
        return Config(recipe=recipe, steps=40, log_every=5, **changes)
    return tiny(**changes)


def interrupted_at(step: int, run: TrainingLoop, signum: int = 15) -> None:
    """Train until a signal arrives during `step`."""
    real = run.trainer.advance
    caught: list[Any] = []
    run_loop = run._loop

    def loop(signals: Any) -> None:
        caught.append(signals)
        run_loop(signals)

    def advance() -> None:
        real()
        if run.trainer.step == step:
            caught[0].handle(signum, None)

    run._loop, run.trainer.advance = loop, advance  # type: ignore[method-assign]
    with pytest.raises(Interrupted) as stop:
        run.train()
    assert stop.value.signum == signum
    assert run.trainer.step == step


def without_time(rows: list[Row]) -> list[str]:
    """Rows as text: NaN equals NaN, and every bit shows."""
    return [repr(row | {"wall_s": 0.0}) for row in rows]


@pytest.mark.parametrize("name", CONFIGS)
def test_resuming_at_ten_random_steps_changes_no_bit(
    name: str, flow: Flow, tmp_path: Path, seed: int
) -> None:
    config = config_of(name)
    whole = make_run(config, flow, tmp_path / "whole")
    whole.train()
    for step in random.Random(seed).sample(range(1, 40), 10):
        folder = tmp_path / f"at {step}"
        interrupted_at(step, make_run(config, flow, folder))
        resumed = make_run(dataclasses.replace(config, resume=True), flow, folder)
        resumed.train()
        expected = whole.trainer.tensors()
        for key, tensor in resumed.trainer.tensors().items():
            assert torch.equal(tensor, expected[key]), key
        assert resumed.trainer.plain_state() == whole.trainer.plain_state()
        assert without_time(resumed.histories[0].rows) == without_time(whole.histories[0].rows)
        rows = [
            [cell for i, cell in enumerate(line.split(",")) if i != 1]
            for path in (folder, tmp_path / "whole")
            for line in (path / "history.csv").read_text().splitlines()
        ]
        assert rows[: len(rows) // 2] == rows[len(rows) // 2 :]
        assert resumed.wall_s > 0


def test_the_history_after_the_checkpoint_is_written_again(flow: Flow, tmp_path: Path) -> None:
    """A killed process leaves more history than its newest checkpoint knows."""
    folder = tmp_path / "run"
    interrupted_at(12, make_run(tiny(), flow, folder))
    with (folder / "history.csv").open("a") as file:
        file.write("15,lost rows\n20,of a killed pro")
    resumed = make_run(tiny(resume=True), flow, folder)
    resumed.train()
    lines = (folder / "history.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["step", *map(str, range(5, 41, 5))]


OTHER_SETTINGS: list[tuple[dict[str, Any], str]] = [
    ({"seed": 1}, "seed = 0, this one has 1"),
    ({"steps": 50}, "steps = 40, this one has 50"),
    ({"network__widths": (9, 8)}, "network.widths"),
    ({"batch__interior": 34}, "batch.interior"),
]
MATERIAL: dict[str, Any] = {
    "grain_diameter": 0.05,
    "density": 1600.0,
    "grain_density": 2500.0,
    "gravity": (0.0, -9.80),
    "length_unit": "mm",
    "time_unit": "ms",
    "density_unit": "kg/m^3",
    "eta_max": 2e4,
    "eta_min": None,
}


@pytest.mark.parametrize(
    ("settings", "changes", "expected"),
    [
        *((settings, {}, words) for settings, words in OTHER_SETTINGS),
        ({}, {"u": 1.01 * make_flow().u}, "another flow file"),
        *(
            ({}, {name: value}, f"belongs to a run with {name} = .*give the same F")
            for name, value in MATERIAL.items()
        ),
    ],
    ids=[*(words for _, words in OTHER_SETTINGS), "data", *MATERIAL],
)
def test_a_checkpoint_of_another_run_is_refused_by_name(
    settings: dict[str, Any], changes: dict[str, Any], expected: str, flow: Flow, tmp_path: Path
) -> None:
    interrupted_at(3, make_run(tiny(), flow, tmp_path / "run"))
    other = dataclasses.replace(flow, **changes)
    with pytest.raises(CheckpointError, match=expected):
        make_run(tiny(resume=True, **settings), other, tmp_path / "run").train()


def test_a_damaged_checkpoint_of_another_run_is_only_damaged(flow: Flow, tmp_path: Path) -> None:
    """What looks like another seed is a flipped bit: the checkpoint before is taken."""
    folder = tmp_path / "run"
    interrupted_at(3, make_run(tiny(), flow, folder))
    interrupted_at(5, make_run(tiny(resume=True), flow, folder))
    (newest,) = folder.glob("checkpoint/step-000000005-*")
    saved = newest.read_bytes()
    newest.write_bytes(saved.replace(rb"\"seed\": 0", rb"\"seed\": 1"))
    assert newest.read_bytes() != saved
    resumed = make_run(tiny(resume=True), flow, folder)
    resumed.train()
    whole = make_run(tiny(), flow)
    whole.train()
    assert torch.equal(resumed.trainer.params, whole.trainer.params)
