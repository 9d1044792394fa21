"""Chunks that threads unpack have their places, and a damaged one is refused as ever."""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from granpinn.arrays import Float32
from granpinn.foreign import hdf5
from granpinn.regular import UnsafeFileError

SHAPE, CHUNK = (41, 5, 7), (2, 5, 4)  # the last chunks reach beyond the data


@pytest.fixture
def values(seed: int) -> Float32:
    return np.random.default_rng(seed).normal(size=SHAPE).astype(np.float32)


@pytest.fixture
def path(values: Float32, tmp_path: Path) -> Path:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        options = {"chunks": CHUNK, "compression": "gzip", "shuffle": True}
        file.create_dataset("a", data=values, **options)
    return path


def read(path: Path) -> Any:
    with hdf5.opened(path) as file:
        return hdf5.values("a", file["a"])


@pytest.mark.parametrize("cores", [1, 2, 16])
def test_every_chunk_has_its_place(
    cores: int, path: Path, values: Float32, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))
    np.testing.assert_array_equal(read(path), values)


def test_a_damaged_chunk_is_refused(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)))
    with h5py.File(path, "r+") as file:
        short = zlib.compress(bytes(12))
        file["a"].id.write_direct_chunk((22, 0, 4), short, filter_mask=0b01)
    with pytest.raises(UnsafeFileError, match="a must have chunks of 160 bytes as declared"):
        read(path)
