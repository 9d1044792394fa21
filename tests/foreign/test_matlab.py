"""MATLAB's version 5, as scipy writes and reads it."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from granpinn.foreign import read_foreign
from granpinn.regular import UnsafeFileError


@pytest.mark.parametrize("compressed", [False, True])
def test_matrices_and_cells(tmp_path: Path, compressed: bool) -> None:
    """All number types; cells of different and equal size, empty ones; other classes are None."""
    rng = np.random.default_rng(1)
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
    variables: dict[str, Any] = {f"m_{k}": (9 * rng.random((3, 5))).astype(k) for k in kinds}
    cells = np.empty((2, 2), object)
    cells[0, 0], cells[0, 1] = rng.random((4, 3)), rng.random((4, 3))
    cells[1, 0], cells[1, 1] = np.empty((0, 0)), rng.random((1, 6))
    variables |= {"cells": cells, "text": "hello", "record": {"a": 1.0}, "number": 2.5}
    savemat(tmp_path / "a.mat", variables | {"other": 1.0}, do_compression=compressed)
    found = read_foreign("matlab", tmp_path / "a.mat", 0, names=[*variables])
    assert found.keys() == variables.keys()
    for kind in kinds:
        np.testing.assert_array_equal(found[f"m_{kind}"], variables[f"m_{kind}"])
    assert found["cells"]["shape"] == [2, 2]
    for cell, expected in zip(found["cells"]["cells"], cells.ravel("F"), strict=True):
        np.testing.assert_array_equal(np.empty((0, 0)) if cell is None else cell, expected)
    assert found["cells"]["cells"][1] is None
    assert found["number"].item() == 2.5
    assert found["text"] == "hello"
    assert found["record"] is None


def element(kind: int, data: bytes) -> bytes:
    return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_big_endian(tmp_path: Path) -> None:
    """As PowerPC Macs wrote it: the same layout the other way round."""
    values = np.arange(6.0).reshape(2, 3)
    matrix = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 2, 3))
    matrix += element(1, b"u") + element(9, values.astype(">f8").tobytes(order="F"))
    content = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + element(14, matrix)
    (tmp_path / "a.mat").write_bytes(content)
    np.testing.assert_array_equal(
        read_foreign("matlab", tmp_path / "a.mat", 0, names=["u"])["u"], values
    )


def test_more_than_allowed_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"a": np.zeros((500, 500))}, do_compression=True)
    with pytest.raises(UnsafeFileError, match="must hold at most 0.000977 GiB of data"):
        read_foreign("matlab", tmp_path / "a.mat", 0, max_bytes=2**20, names=["a"])


def test_declared_gigabytes_are_not_allocated(tmp_path: Path) -> None:
    """A packed matrix of 2 GiB in a small file."""
    size = struct.pack(">ii", 2**14, 2**14)
    matrix = element(6, struct.pack(">II", 6, 0)) + element(5, size) + element(1, b"u")
    matrix += struct.pack(">II", 9, 2**31) + bytes(2**20)
    packed = zlib.compress(struct.pack(">II", 14, len(matrix) - 2**20 + 2**31) + matrix)
    content = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + struct.pack(">II", 15, len(packed))
    (tmp_path / "a.mat").write_bytes(content + packed)
    with pytest.raises(UnsafeFileError, match="its arrays need more than .* GiB of memory"):
        read_foreign("matlab", tmp_path / "a.mat", 0, names=["u"])
