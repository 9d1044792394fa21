"""Frames that threads compress are stored as HDF5 stores them."""

from __future__ import annotations

import time
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
import pytest

from granpinn.output import hdf5_file
from granpinn.output.hdf5 import AHEAD, MOST, PACKED, write_frames

SHAPES = [(100, 9, 7), (3, 5, 4, 3), (1, 1, 1), (5, 8)]


def values_of(shape: tuple[int, ...], dtype: str, seed: int) -> npt.NDArray[Any]:
    """Numbers that compress, with gaps where the type has them."""
    values = np.rint(100 * np.random.default_rng(seed).normal(size=shape)).astype(dtype)
    if values.dtype.kind == "f":
        values[values > 150] = np.nan
    return values


def create(file: h5py.File, values: npt.NDArray[Any]) -> h5py.Dataset:
    chunks = (1, *values.shape[1:])
    return file.create_dataset("a", values.shape, values.dtype, chunks=chunks, **PACKED)


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", "<i2", "u1"])
@pytest.mark.parametrize("shape", SHAPES)
def test_chunks_are_those_of_hdf5(
    shape: tuple[int, ...], dtype: str, seed: int, tmp_path: Path
) -> None:
    values = values_of(shape, dtype, seed)
    with hdf5_file(tmp_path / "threads.h5") as file:
        write_frames(create(file, values), lambda k: values[k])
    with h5py.File(tmp_path / "hdf5.h5", "w") as file:
        dataset = create(file, values)
        for k, frame in enumerate(values):
            dataset[k] = frame
    with h5py.File(tmp_path / "threads.h5") as own, h5py.File(tmp_path / "hdf5.h5") as theirs:
        np.testing.assert_array_equal(own["a"][()], values)
        for k in range(len(values)):
            place = (k, *(0,) * (values.ndim - 1))
            assert own["a"].id.read_direct_chunk(place)[0] == 0
            found, wanted = (f["a"].id.read_direct_chunk(place)[1] for f in (own, theirs))
            assert zlib.decompress(found) == zlib.decompress(wanted)


def test_frames_keep_their_places_whichever_is_ready_first(tmp_path: Path) -> None:
    values = np.arange(60.0, dtype=np.float32).reshape(10, 3, 2)

    def frame(k: int) -> npt.NDArray[Any]:
        time.sleep(0.002 * (9 - k))
        return values[k]

    with hdf5_file(tmp_path / "a.h5") as file:
        write_frames(create(file, values), frame)
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["a"][()], values)


def test_an_error_in_a_frame_leaves_the_old_file(tmp_path: Path) -> None:
    values = np.zeros((1000, 2, 2), np.float32)
    path, asked = tmp_path / "a.h5", list[int]()
    path.write_text("old")

    def frame(k: int) -> npt.NDArray[Any]:
        if k == 0:
            time.sleep(0.2)
            raise ValueError("no frame")
        asked.append(k)
        return values[k]

    with pytest.raises(ValueError, match="no frame"), hdf5_file(path) as file:
        write_frames(create(file, values), frame)
    assert len(asked) <= AHEAD * MOST  # later frames wait until these are stored
    assert path.read_text() == "old"
