"""MATLAB files of version 5 to 7: numbers, characters and cell arrays; the rest is skipped.

This module exists because scipy.io.loadmat crashes the process on some damaged files. The layout is
that of "MAT-File Format" (MathWorks): a header of 128 bytes, then elements of a tag (type and size,
4 or 8 bytes) and data, padded to 8 bytes; a matrix is an element that holds flags, dimensions, name
and values; an element may be compressed.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

HEADER = 128
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
    16: "u1",  # UTF-8
    17: "u2",  # UTF-16
}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _CHARACTERS = 1, 4
_NUMBERS = range(6, 16)  # classes of matrices: double, single, and the integers
_MAX_DEPTH = 3
_NOTHING = (2, memoryview(b""))  # numbers of a matrix without any
_MAX_ELEMENTS = 4_000_000  # a session of 60,000 frames


class Mat5Error(ValueError):
    """The file breaks the layout."""


def read_variables(content: bytes, max_bytes: int) -> dict[str, Any]:
    """All matrices and cell arrays by name: arrays in their stored type, and object arrays of them
    or None.

    Characters are their code points, as in version 7.3.

    Args:
        content: of the file.
        max_bytes: largest size of the unpacked content.
    """
    if len(content) < HEADER or content[126:128] not in (b"IM", b"MI"):
        raise Mat5Error("it has no header of version 5")
    order = "<" if content[126:128] == b"IM" else ">"
    reader = _Reader(order, max_bytes)
    found = {}
    for kind, data in reader.elements(memoryview(content)[HEADER:]):
        packed = kind == _COMPRESSED
        inside = reader.elements(reader.inflate(data)) if packed else iter([(kind, data)])
        for inner, matrix in inside:
            if inner == _MATRIX and matrix:
                name, value = reader.matrix(matrix, 0)
                found[name] = value
    return found


class _Reader:
    def __init__(self, order: str, max_bytes: int) -> None:
        self.order = order
        self.left = max_bytes
        self.elements_left = _MAX_ELEMENTS

    def inflate(self, data: memoryview) -> memoryview:
        """The content of a compressed element."""
        try:
            raw = zlib.decompressobj().decompress(data, self.left)
        except zlib.error:
            raise Mat5Error("a compressed part is damaged") from None
        self.left -= len(raw)
        if self.left <= 0:
            raise Mat5Error("it holds too much data")
        return memoryview(raw)

    def elements(self, data: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Type and data of the elements that follow one another."""
        at = 0
        while at < len(data):
            self.elements_left -= 1
            if self.elements_left < 0:
                raise Mat5Error("it holds too many parts")
            if len(data) - at < 8:
                raise Mat5Error("it was cut off")
            (first,) = struct.unpack_from(f"{self.order}I", data, at)
            kind, size = first & 0xFFFF, first >> 16
            if size:  # the short form: type, size and data in 8 bytes
                if size > 4:
                    raise Mat5Error("a short element is too long")
                start, end = at + 4, at + 8
            else:
                (size,) = struct.unpack_from(f"{self.order}I", data, at + 4)
                start = at + 8
                padded = size if kind == _COMPRESSED else -(-size // 8) * 8
                end = start + padded
            if start + size > len(data):
                raise Mat5Error("it was cut off")
            yield kind, data[start : start + size]
            at = end

    def numbers(self, kind: int, data: memoryview) -> Any:
        if kind not in _TYPES:
            raise Mat5Error(f"numbers of the unknown type {kind}")
        dtype = np.dtype(self.order + _TYPES[kind])
        if len(data) % dtype.itemsize:
            raise Mat5Error("numbers are cut off")
        return np.frombuffer(data, dtype)

    def matrix(self, data: memoryview, depth: int) -> tuple[str, Any]:
        """Name and value of a matrix; None unless it has numbers or is a cell array."""
        parts = self.elements(data)
        try:
            flags, dimensions, name = (next(parts) for _ in range(3))
        except RuntimeError:  # StopIteration inside the generator expression
            raise Mat5Error("a matrix has no flags, dimensions or name") from None
        kind = int(self.numbers(*flags)[0]) & 0xFF if flags[1] else 0
        shape = tuple(int(n) for n in self.numbers(*dimensions))
        label = bytes(name[1]).decode("ascii", "replace")
        if any(n < 0 for n in shape) or len(shape) < 2:
            raise Mat5Error("a matrix has wrong dimensions")
        size = math.prod(shape)
        if kind in _NUMBERS:
            values = self.numbers(*next(parts, _NOTHING))
            if values.size != size:
                raise Mat5Error(f"{label} does not hold the {size} numbers that it declares")
            return label, values.reshape(shape, order="F")
        if kind == _CHARACTERS:
            codes = self.numbers(*next(parts, _NOTHING))
            # UTF-8 beyond ASCII has more bytes than characters; no text that is read has any.
            return label, codes if codes.size == size else None
        if kind != _CELL or depth >= _MAX_DEPTH:
            return label, None
        cells = []
        for inner, content in parts:
            if inner != _MATRIX:
                raise Mat5Error(f"a cell of {label} is no matrix")
            cells.append(self.matrix(content, depth + 1)[1] if content else None)
        if len(cells) != size:
            raise Mat5Error(f"{label} does not hold the {size} cells that it declares")
        table = np.empty(size, object)
        for i, cell in enumerate(cells):
            table[i] = cell
        return label, table.reshape(shape, order="F")
