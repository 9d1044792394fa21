"""Attributes as they lie in the file, read from its bytes without HDF5.

HDF5 allocates what a variable-length attribute declares, up to 4 GiB, runs without end through a
damaged heap, and crashes on a damaged type. So the raw value of such an attribute is looked up
here; see the "HDF5 File Format Specification", version 3.0: object headers (IV.A), attribute
messages (IV.A.2.m), and for objects with many attributes the fractal heap (III.G) and the B-tree
(III.A.2) of their names. Every loop is bounded; bytes beyond the file raise struct.error.
"""

from __future__ import annotations

from collections.abc import Iterator
from struct import unpack_from

from granpinn.data.hdf5.content import Content
from granpinn.regular import UnsafeFileError

MAX_MESSAGES = 10_000
UNDEFINED = 2**64 - 1
_ATTRIBUTE, _CONTINUATION, _ATTRIBUTE_INFO = 0x0C, 0x10, 0x15
_SHARED = 0x02
_BY_NAME = 8  # the type of a B-tree of attribute names
_LEAF_OVERHEAD = 10  # bytes of signature, version, type and checksum


def raw_attribute(file: Content, header: int, name: str) -> bytes:
    """The stored value of the attribute of an object.

    Args:
        header: address of its object header.

    Raises:
        UnsafeFileError: there is none, or the file stores it in an unusual way.
    """
    wanted = name.encode()
    for message in _attributes(file, header):
        found, value = _split(message)
        if found == wanted:
            return value
    raise UnsafeFileError(f"the attribute {name} must lie in the file, got none: make it again")


def _attributes(file: Content, header: int) -> Iterator[bytes]:
    """Attribute messages of an object, in its header or in its heap."""
    for kind, flags, data in _messages(file, header):
        if kind == _ATTRIBUTE and not flags & _SHARED:
            yield data
        if kind == _ATTRIBUTE_INFO:
            at = 4 if data[1] & 1 else 2
            heap, names = unpack_from("<QQ", data, at)
            if heap != UNDEFINED:
                yield from _dense(file, heap, names)


def _messages(file: Content, header: int) -> Iterator[tuple[int, int, bytes]]:
    """Type, flags and data of all messages of an object header, of version 1 or 2."""
    second = file.at(header, 4) == b"OHDR"
    flags = file.at(header + 5, 1)[0] if second else 0
    if second:
        start = header + 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
        width = 1 << (flags & 3)
        length = int.from_bytes(file.at(start, width), "little")
        blocks = [(start + width, length)]
    else:
        blocks = [(header + 16, *unpack_from("<I", file.at(header + 8, 4)))]
    form, extra = ("<BHB", 2 * bool(flags & 4)) if second else ("<HHB", 3)
    count = 0
    while blocks:
        start, length = blocks.pop(0)
        at, head = 0, (4 if second else 5) + extra
        while at + head <= length:
            kind, size, marks = unpack_from(form, file.at(start + at, head))
            data = file.at(start + at + head, size)
            at += head + size
            count += 1
            if count > MAX_MESSAGES:
                raise UnsafeFileError(
                    f"an object must have at most {MAX_MESSAGES} messages, got more: make the file "
                    "again"
                )
            if kind == _CONTINUATION:
                place, extent = unpack_from("<QQ", data)
                # In version 2 the block has a signature and a checksum.
                blocks.append((place + 4, extent - 8) if second else (place, extent))
            else:
                yield kind, marks, data


def _split(message: bytes) -> tuple[bytes, bytes]:
    """Name and value of an attribute message."""
    version, flags, *sizes = unpack_from("<BBHHH", message)
    if version not in (1, 2, 3) or (version > 1 and flags & 3):
        return b"", b""  # a type that is stored elsewhere
    padded = [-(-size // 8) * 8 for size in sizes] if version == 1 else sizes
    start = 9 if version == 3 else 8
    name = message[start : start + sizes[0]].rstrip(b"\0")
    return name, message[start + sum(padded) :]


def _dense(file: Content, heap: int, names: int) -> Iterator[bytes]:
    """Attribute messages of a heap, in the order of its B-tree of names."""
    (id_bytes,) = unpack_from("<H", file.at(heap + 5, 2))
    width, first, _, bits, _, root, rows = unpack_from("<HQQHHQH", file.at(heap + 110, 32))
    offset_bytes = -(-bits // 8)
    for record in _records(file, names):
        if record[0] & 0x30:
            continue  # an object outside of the blocks: longer than any attribute that is read
        offset = int.from_bytes(record[1 : 1 + offset_bytes], "little")
        length = int.from_bytes(record[1 + offset_bytes : id_bytes], "little")
        block = root
        if rows:  # the root lists blocks of first, first, 2 first, 4 first, ... bytes, in rows
            row, start, size = 0, 0, first
            while row < rows and offset >= start + width * size:
                start += width * size
                row += 1
                size = first << max(row - 1, 0)
            column, offset = divmod(offset - start, size) if size else (0, 0)
            entries = root + 5 + 8 + offset_bytes
            (block,) = unpack_from("<Q", file.at(entries + 8 * (row * width + column), 8))
        yield file.at(block + offset, length)


def _records(file: Content, tree: int) -> Iterator[bytes]:
    """Records of a B-tree of version 2, of at most two levels."""
    kind, node_bytes, size, depth = unpack_from("<BIHH", file.at(tree + 5, 9))
    root, count = unpack_from("<QH", file.at(tree + 16, 10))
    if kind != _BY_NAME or depth > 1 or size < 8:
        raise UnsafeFileError("an object must have at most 256 attributes, got more: remove some")
    nodes = [(root, count)]
    if depth:
        yield from _node(file, root, count, size)
        per_leaf = (node_bytes - _LEAF_OVERHEAD) // size
        count_bytes = (max(per_leaf, 1).bit_length() + 7) // 8
        children = root + 6 + count * size
        nodes = []
        for k in range(min(count, MAX_MESSAGES) + 1):
            child = file.at(children + k * (8 + count_bytes), 8 + count_bytes)
            nodes.append((int.from_bytes(child[:8], "little"), int.from_bytes(child[8:], "little")))
    for node, number in nodes:
        yield from _node(file, node, min(number, MAX_MESSAGES), size)


def _node(file: Content, node: int, count: int, size: int) -> Iterator[bytes]:
    for k in range(count):
        yield file.at(node + 6 + k * size, size)
