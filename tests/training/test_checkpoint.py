"""Gates F-3 and T-6: a damaged checkpoint is passed over, and reading it runs no code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.training import checkpoint
from granpinn.training.checkpoint import (
    CheckpointError,
    RunState,
    TrainingState,
    newest,
    require_same,
    restore,
    save,
)
from granpinn.training.identity import plain

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
    live = {k: torch.zeros_like(t) for k, t in TENSORS.items()}
    restore(found, live)
    for name, tensor in live.items():
        assert torch.equal(tensor, TENSORS[name] + 7)


def test_the_two_newest_are_kept(tmp_path: Path) -> None:
    saved(tmp_path, 5, 80, 1000, 900)
    (tmp_path / ".step-000000001.json.0123abcd.tmp").write_text("left by a killed process")
    saved(tmp_path, 1001)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        f"step-{step:09d}.{suffix}" for step in (1000, 1001) for suffix in ("json", "safetensors")
    ]


def test_files_of_the_user_are_not_removed_nor_read(tmp_path: Path) -> None:
    own = ["step-notes.txt", "step-1.json", ".step-old.tmp", "step-000000001.json.bak"]
    own += ["step-x.json", "step-٣٣٣٣٣٣٣٣٣.json", "step-000002000.json.bak"]
    for name in own:
        (tmp_path / name).write_text("{}")
    saved(tmp_path, 5, 80, 1000)
    assert {path.name for path in tmp_path.iterdir()} >= set(own)
    assert not (tmp_path / "step-000000005.json").exists()
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 1000


DAMAGE = {
    "tensors cut": ("safetensors", lambda b: b[:-3]),
    "tensors changed": ("safetensors", lambda b: b[:-1] + bytes([b[-1] ^ 1])),
    "tensors empty": ("safetensors", lambda b: b""),
    "state cut": ("json", lambda b: b[: len(b) // 2]),
    "state of another program": ("json", lambda b: b'{"step": 1}'),
    "state is a list": ("json", lambda b: b"[1, 2]"),
    "state with NaN": ("json", lambda b: b.replace(b'"wall_s": 2.0', b'"wall_s": NaN')),
    "state is binary": ("json", lambda b: b"\xff\xfe"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_checkpoint_is_passed_over(case: str, tmp_path: Path) -> None:
    suffix, damage = DAMAGE[case]
    saved(tmp_path, 1, 2)
    path = tmp_path / f"step-000000002.{suffix}"
    path.write_bytes(damage(path.read_bytes()))
    found = newest(tmp_path)
    assert found is not None
    assert found.state.training.step == 1
    (tmp_path / "step-000000001.safetensors").unlink()
    with pytest.raises(CheckpointError, match="no checkpoint can be read"):
        newest(tmp_path)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_what_is_not_finite_is_never_saved(bad: float, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="params holds a NaN or an infinity at step 3"):
        save(tmp_path, {"params": torch.tensor([1.0, bad])}, HISTORIES, state_at(3))
    assert not list(tmp_path.iterdir())


def test_what_is_not_finite_is_never_restored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint.torch, "isfinite", torch.ones_like)
        save(tmp_path, {"params": torch.tensor([1.0, float("nan")])}, HISTORIES, state_at(3))
    found = newest(tmp_path)
    assert found is not None
    with pytest.raises(CheckpointError, match="params holds a NaN"):
        restore(found, {"params": torch.zeros(2)})


def test_tensors_must_fit(tmp_path: Path) -> None:
    saved(tmp_path, 1)
    found = newest(tmp_path)
    assert found is not None
    live = {k: torch.zeros_like(t) for k, t in TENSORS.items()}
    with pytest.raises(CheckpointError, match=r"params must be torch.float32 \[2\], got .* \[6\]"):
        restore(found, live | {"params": torch.zeros(2)})
    with pytest.raises(CheckpointError, match=r"q must be torch.float32 \[2\], got .*64"):
        restore(found, live | {"q": torch.zeros(2)})
    with pytest.raises(CheckpointError, match="differ in the tensors more"):
        restore(found, live | {"more": torch.zeros(2)})
    assert not live["params"].any()


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
    path = folder / f"step-{step:09d}.json"
    content = json.loads(path.read_text())
    for name, value in changes.items():
        place, _, key = name.rpartition("__")
        (content[place] if place else content)[key] = value
    binary = path.with_suffix(".safetensors").read_bytes()
    content["sha256"] = checkpoint._checksum(content, binary)
    path.write_bytes(checkpoint._text(content))


IMPOSSIBLE: list[dict[str, Any]] = [
    {"training__step": -5},
    {"training__step": 1},
    {"training__step": 2.0},
    {"training__step": True},
    {"training__step": "2"},
    {"training__step": 2**70},
    {"training__total": 1},
    {"training__from_step": 3},
    {"training__from_progress": 1.5},
    {"training__lr_scale": [1.0]},
    {"training__lr_scale": [1.0, 1e308]},
    {"training__misfit": [0.0, -1.0]},
    {"training__diverged": {"2": "no such member"}},
    {"training__more": 1},
    {"step": 1},
    {"step": 7, "training__step": 7},
    {"wall_s": -1.0},
    {"wall_s": None},
    {"stopped": "later"},
    {"members": []},
    {"members": [{}]},
    {"settings": []},
    {"data_sha256": 3},
    {"format_version": 2},
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
    """Gate T-6: all bits of the JSON and of the tensors' header, every seventh of the tensors."""
    saved(tmp_path, 2)
    path = tmp_path / "step-000000002.json"
    for place in (path, path.with_suffix(".safetensors")):
        whole = place.read_bytes()
        header = len(whole) - 4 * 6 - 8 * 2 - 4 * 2
        for bit in (*range(8 * header), *range(8 * header, 8 * len(whole), 7)):
            damaged = bytearray(whole)
            damaged[bit // 8] ^= 1 << bit % 8
            place.write_bytes(damaged)
            with pytest.raises((ValueError, RecursionError)):  # those that `newest` passes over
                checkpoint._read(path)
        place.write_bytes(whole)
    assert checkpoint._read(path).state == state_at(2)


def test_a_run_folder_that_vanished_is_not_made_again(tmp_path: Path) -> None:
    folder = tmp_path / "run" / "checkpoint"
    with pytest.raises(CheckpointError, match="run was removed during the run"):
        saved(folder, 1)
    assert not (tmp_path / "run").exists()
