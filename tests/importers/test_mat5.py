"""The reader of MATLAB's version 5 against the files that scipy writes."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from granpinn.importers.mat5 import Mat5Error, read_variables

LIMIT = 2**20


def written(path: Path, variables: dict[str, Any], compressed: bool = False) -> bytes:
    savemat(path, variables, do_compression=compressed)
    return path.read_bytes()


@pytest.mark.parametrize("compressed", [False, True])
def test_matrices_and_cells(tmp_path: Path, compressed: bool) -> None:
    """All number types; cells of different and equal size, empty ones; other classes are None."""
    rng = np.random.default_rng(1)
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
    variables: dict[str, Any] = {f"m_{k}": (9 * rng.random((3, 5))).astype(k) for k in kinds}
    cells = np.empty((2, 2), object)
    cells[0, 0], cells[0, 1] = rng.random((4, 3)), rng.random((4, 3))
    cells[1, 0], cells[1, 1] = np.empty((0, 0)), rng.random((1, 6))
    one = np.empty((1, 1), object)
    one[0, 0] = rng.random((2, 7))
    variables |= {"cells": cells, "one": one, "text": "hello", "record": {"a": 1.0}, "number": 2.5}
    found = read_variables(written(tmp_path / "a.mat", variables, compressed), LIMIT)
    for kind in kinds:
        np.testing.assert_array_equal(found[f"m_{kind}"], variables[f"m_{kind}"])
    for index in np.ndindex(2, 2):
        np.testing.assert_array_equal(found["cells"][index], cells[index])
    np.testing.assert_array_equal(found["one"][0, 0], one[0, 0])
    assert found["number"].item() == 2.5
    assert bytes(found["text"].ravel().astype(int).tolist()) == b"hello"
    assert found["record"] is None


def element(kind: int, data: bytes) -> bytes:
    return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_big_endian() -> None:
    """As PowerPC Macs wrote it: the same layout the other way round."""
    values = np.arange(6.0).reshape(2, 3)
    matrix = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 2, 3))
    matrix += element(1, b"u") + element(9, values.astype(">f8").tobytes(order="F"))
    content = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + element(14, matrix)
    np.testing.assert_array_equal(read_variables(content, LIMIT)["u"], values)


def test_more_than_allowed_is_not_unpacked(tmp_path: Path) -> None:
    content = written(tmp_path / "a.mat", {"a": np.zeros((500, 500))}, compressed=True)
    assert len(content) < 20_000
    with pytest.raises(Mat5Error, match="holds too much data"):
        read_variables(content, LIMIT)


def header(element_bytes: bytes) -> bytes:
    return b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + element_bytes


def little(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


FLAGS = little(6, bytes([6, 0, 0, 0] * 2))
SHAPE = little(5, bytes([2, 0, 0, 0] * 2))
NAME = little(1, b"u")
CELL = little(6, bytes([1, 0, 0, 0] * 2))
WRONG = {
    "no header": (b"x" * 200, "no header of version 5"),
    "cut tag": (header(b"\x0e\0\0"), "cut off"),
    "cut element": (header(struct.pack("<II", 14, 99)), "cut off"),
    "long short element": (header(struct.pack("<HHI", 5, 9, 0)), "short element is too long"),
    "damaged zip": (header(little(15, b"nothing")), "a compressed part is damaged"),
    "no parts": (header(little(14, FLAGS)), "no flags, dimensions or name"),
    "dimensions": (header(little(14, FLAGS + little(5, b"\xff" * 8) + NAME)), "wrong dimensions"),
    "few numbers": (header(little(14, FLAGS + SHAPE + NAME)), "hold the 4 numbers that it decl"),
    "cut numbers": (header(little(14, FLAGS + SHAPE + NAME + little(9, b"123"))), "are cut off"),
    "unknown numbers": (header(little(14, FLAGS + little(8, b"") + NAME)), "unknown type 8"),
    "few cells": (header(little(14, CELL + SHAPE + NAME)), "hold the 4 cells that it declares"),
    "no cell": (header(little(14, CELL + SHAPE + NAME + little(9, b""))), "is no matrix"),
    "zip of rubbish": (header(little(15, zlib.compress(b"abc"))), "cut off"),
}


@pytest.mark.parametrize(("content", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_layouts_are_refused(content: bytes, message: str) -> None:
    with pytest.raises(Mat5Error, match=message):
        read_variables(content, LIMIT)
