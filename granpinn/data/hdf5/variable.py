"""Variable-length values of attributes: text, and the dimension scales of a variable."""

from __future__ import annotations

import struct
from struct import unpack_from

from granpinn.data.hdf5.content import Content
from granpinn.data.hdf5.messages import UNDEFINED
from granpinn.regular import UnsafeFileError

_DESCRIPTOR = 16  # bytes: length, address of the heap, index in it
_MAX_OBJECTS = 2**16
_MAX_BYTES = 65536


def sequences(file: Content, raw: bytes, count: int) -> list[bytes]:
    """The bytes of variable-length values; b"" of an empty one.

    Args:
        raw: stored value of the attribute.
        count: of the values.
    """
    if len(raw) < count * _DESCRIPTOR:
        raise struct.error("a variable-length attribute is cut off")
    found = []
    for k in range(count):
        length, heap, index = unpack_from("<IQI", raw, k * _DESCRIPTOR)
        empty = length == 0 or heap in (0, UNDEFINED)
        found.append(b"" if empty else _heap_entry(file, heap, index))
    return found


def _heap_entry(file: Content, heap: int, wanted: int) -> bytes:
    """An object of a global heap collection (III.E of the specification)."""
    signature, total = unpack_from("<4s4xQ", file.at(heap, 16))
    if signature != b"GCOL":
        raise struct.error("a variable-length attribute names no heap")
    at = 16
    for _ in range(_MAX_OBJECTS):
        if at + 16 > total:
            break
        index, size = unpack_from("<H6xQ", file.at(heap + at, 16))
        if index == 0:
            break
        if index == wanted:
            if size > _MAX_BYTES:
                raise UnsafeFileError(
                    f"an attribute must be at most {_MAX_BYTES} bytes long, got {size}: shorten it"
                )
            return file.at(heap + at + 16, size)
        at += 16 + -(-size // 8) * 8
    raise struct.error("a variable-length attribute names no object of its heap")
