"""Gates F-3 and T-6: a damaged checkpoint is passed over, and reading it runs no code."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors import torch as safetensors

from granpinn.results.decoding import plain
from granpinn.training import checkpoint
from granpinn.training.checkpoint import (
    CheckpointError,
    RunState,
    TrainingState,
    newest,
    require_same,
    save,
)

TENSORS = {"params": torch.arange(6.0), "q": torch.tensor([1.0, 2.0], dtype=torch.float64)}

HISTORIES = [torch.tensor([[1.0, torch.nan]]), torch.zeros(0, 2)]


def state_at(step: int) -> RunState:
    return RunState(
        training=TrainingState(
            step=step,
            lr_scale=(1.0, 0.5),
            misfit=(0.0, 0.25),
            diverged={"1": "the loss became NaN"},
            total=2000,
            from_step=0,
            from_progress=0.0,
        ),
        wall_s=float(step),
        stopped="steps",
        settings={"seed": 3, "sigma": None},
        members=({"grain_diameter": 0.025, "weights": [1.0, 2.0]}, {"grain_diameter": 0.025}),
        data_sha256="abc",
    )


def saved(folder: Path, *steps: int) -> None:
    for step in steps:
        save(folder, {k: t + step for k, t in TENSORS.items()}, HISTORIES, state_at(step))


def test_what_is_saved_comes_back(tmp_path: Path) -> None:
    saved(tmp_path, 7)
    found = newest(tmp_path)
    assert found is not None
    assert found.state == state_at(7)
    for table, expected in zip(found.histories, HISTORIES, strict=True):
        torch.testing.assert_close(table, expected, rtol=0, atol=0, equal_nan=True)
    assert found.tensors.keys() == TENSORS.keys()
    for name, tensor in found.tensors.items():
        assert torch.equal(tensor, TENSORS[name] + 7)


def test_the_two_newest_are_kept(tmp_path: Path) -> None:
    saved(tmp_path, 5, 80, 1000, 900)
    left = f".step-000000001-{'0' * 16}.safetensors.0123abcd.tmp"
    (tmp_path / left).write_text("left by a killed process")
    saved(tmp_path, 1001, 1001)
    assert [p.name[:14] for p in sorted(tmp_path.iterdir())] == ["step-000000900", "step-000001001"]


def test_files_of_the_user_are_not_removed_nor_read(tmp_path: Path) -> None:
    end = f"{'0' * 16}.safetensors"
    own = ["step-notes.txt", f"step-1-{end}", ".step-old.tmp", f"step-000000001-{end}.bak"]
    own += ["step-000000001.safetensors", f"step-٣٣٣٣٣٣٣٣٣-{end}", f"step-x-{end}"]
    for name in own:
        (tmp_path / name).write_text("{}")
    saved(tmp_path, 5, 80, 1000)
    assert {path.name for path in tmp_path.iterdir()} >= set(own)
    assert len([*tmp_path.iterdir()]) == len(own) + 2
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 1000


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda b: b[:-3],
    "changed": lambda b: b[:-1] + bytes([b[-1] ^ 1]),
    "empty": lambda b: b"",
    "half": lambda b: b[: len(b) // 2],
    "NaN": lambda b: b.replace(rb"\"wall_s\": 2.0", rb"\"wall_s\": NaN"),
}


def path_of(folder: Path, step: int) -> Path:
    (path,) = folder.glob(f"step-{step:09d}-*.safetensors")
    return path


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_checkpoint_is_passed_over(case: str, tmp_path: Path) -> None:
    saved(tmp_path, 1, 2)
    path = path_of(tmp_path, 2)
    whole = path.read_bytes()
    path.write_bytes(DAMAGE[case](whole))
    assert path.read_bytes() != whole
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 1
    path_of(tmp_path, 1).write_bytes(whole)
    with pytest.raises(CheckpointError, match="no checkpoint can be read"):
        newest(tmp_path)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_what_is_not_finite_is_never_saved(bad: float, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="params holds a NaN or an infinity at step 3"):
        save(tmp_path, {"params": torch.tensor([1.0, bad])}, HISTORIES, state_at(3))
    assert not list(tmp_path.iterdir())


def test_another_run_is_refused_with_the_difference(tmp_path: Path) -> None:
    saved(tmp_path, 1)
    found = newest(tmp_path)
    assert found is not None
    state = found.state
    settings, members = {"seed": 3, "sigma": plain(float("inf"))}, state.members
    require_same(found, settings, members, "abc")
    with pytest.raises(CheckpointError, match="a run with seed = 3, this one has 4"):
        require_same(found, settings | {"seed": 4}, members, "abc")
    with pytest.raises(CheckpointError, match="a run with 2 members, this one has 1"):
        require_same(found, settings, members[:1], "abc")
    other = (members[0], {"grain_diameter": 0.05})
    with pytest.raises(CheckpointError, match="with grain_diameter = 0.025, this one has 0.05"):
        require_same(found, settings, other, "abc")
    with pytest.raises(CheckpointError, match="on another flow file"):
        require_same(found, settings, members, "def")


def forged(folder: Path, step: int, /, **changes: Any) -> None:
    """A checkpoint with other values and a checksum that fits them."""
    path = path_of(folder, step)
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    record = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["granpinn"])
    for name, value in changes.items():
        place, _, key = name.rpartition("__")
        (record[place] if place else record)[key] = value
    content = safetensors.save(safetensors.load(content), {"granpinn": json.dumps(record)})
    path.unlink()
    path = folder / f"step-{step:09d}-{hashlib.sha256(content).hexdigest()[:16]}.safetensors"
    path.write_bytes(content)


IMPOSSIBLE: list[dict[str, Any]] = [
    {"training__step": 2.0},
    {"training__step": True},
    {"training__step": "2"},
    {"training__more": 1},
    {"training__lr_scale": 1.0},
    {"wall_s": None},
    {"members": [{}, {}, {}]},
    {"settings": []},
    {"data_sha256": 3},
    {"format_version": 5},
    {"more": 1},
]


@pytest.mark.parametrize("changes", IMPOSSIBLE, ids=str)
def test_impossible_values_are_damage_whatever_their_checksum(
    changes: dict[str, Any], tmp_path: Path
) -> None:
    saved(tmp_path, 1, 2)
    forged(tmp_path, 2)
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 2
    forged(tmp_path, 2, **changes)
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 1


def test_every_flipped_bit_is_damage(tmp_path: Path) -> None:
    """Gate T-6: all bits of the header with the plain values, every seventh of the tensors."""
    saved(tmp_path, 2)
    path = path_of(tmp_path, 2)
    whole = path.read_bytes()
    header = len(whole) - 4 * 6 - 8 * 2 - 4 * 2
    for bit in (*range(8 * header), *range(8 * header, 8 * len(whole), 7)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="it was changed after it was saved"):
            checkpoint._read(path)
    path.write_bytes(whole)
    assert checkpoint._read(path).state == state_at(2)


def test_a_run_folder_that_vanished_is_not_made_again(tmp_path: Path) -> None:
    folder = tmp_path / "run" / "checkpoint"
    with pytest.raises(CheckpointError, match="run was removed during the run"):
        saved(folder, 1)
    assert not (tmp_path / "run").exists()
