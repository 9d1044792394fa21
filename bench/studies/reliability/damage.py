"""Damage to files: bytes, tokens of text, values of JSON. A pure function of the random numbers."""

from __future__ import annotations

import json
import re
from random import Random
from typing import Any

START = 4096  # where most formats have their structure
MOST = 2**22  # bytes that a damaged file may have
NUMBERS = (
    *("nan", "NaN", "-inf", "inf", "1e308", "-1e308", "1e400", "5e-324", "-0.0", "0", "-1", "1"),
    *("9" * 5000, "1" + "0" * 400, "2147483648", "-9223372036854775809", "18446744073709551616"),
    *("1e-400", "0x10", "1_000", "1,5", "٣", "²", "1e", "--1", "+", ".", "1d5", "True", "None"),
)
WORDS = (
    *("", " ", "a" * 70_000, "\x00", "\ufeff", '"', "'", "\\", "\r", "\n", "\n\n", "\t", ",", ";"),
    *("#", "%", "[", "](", "(" * 2000, "m" * 3000, "m/s" * 500, "m**9999", "m^-1e9", "1/0 m"),
    *("<script>", "../../etc/passwd", "file:///etc/passwd", "\ud7ff", "é" * 999, "\x1b[2J"),
    *(" " * 50_000, "1 " * 40_000, "x [" + " " * 20_000, "{" * 3000, "kg m" * 2000, "%s%n"),
)
JSON_VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 2**64, 10**400, 1e308, -1e308, 5e-324, 1e-300),
    *("", "nan", "a" * 70_000, [], {}, [[]], [1e308] * 3, {"a": 1}, [None], "<b>", "\u0000"),
    *(float("nan"), float("inf"), ["x"] * 2000, [0] * 100_000, "pickle", "../a", "|O", "<U999"),
)
SEPARATOR = re.compile(rb"([\s,;=()\[\]{}<>\"']+)")


def damaged(content: bytes, draw: Random, other: bytes) -> bytes:
    """A file with one to a few places damaged.

    Args:
        draw: source of the random numbers.
        other: another valid file, for splices.
    """
    text = b"\0" not in content  # which has tokens
    for _ in range(draw.choice((1, 1, 1, 1, 2, 3, 6))):
        if content[:1] == b"{" and draw.random() < 0.7:
            content = json_value(content, draw)
        elif text and draw.random() < 0.7:
            content = token(content, draw)
        else:
            content = byte(content, draw, other)
    return content[:MOST]


def byte(content: bytes, draw: Random, other: bytes) -> bytes:
    """Flip, overwrite, delete, insert, truncate or splice."""
    if not content:
        return other[: draw.randrange(1, 99)]
    at = draw.randrange(min(len(content), draw.choice((START, len(content)))))
    length = draw.choice((1, 2, 4, 8, draw.randrange(1, 64), draw.randrange(1, 4096)))
    kind = draw.randrange(9)
    if kind == 0:
        return content[:at]
    if kind == 1:
        return content[:at] + content[at + length :]
    if kind == 2:
        origin = draw.randrange(len(content))
        return content[:at] + content[origin : origin + length] + content[at:]
    if kind == 3 and other:
        return content[:at] + other[draw.randrange(len(other)) :]
    changed = bytearray(content)
    if kind in (4, 5):
        changed[at] ^= 1 << draw.randrange(8)
    elif kind == 6:
        size = draw.choice((2, 4, 8))
        value = draw.choice((0, 1, -1, 2**15, 2**31 - 1, 2**31, 2**62, 2**63 - 1)) % 2 ** (8 * size)
        changed[at : at + size] = value.to_bytes(size, draw.choice(("little", "big")))
    elif kind == 7:
        changed[at : at + length] = draw.randbytes(min(length, len(content) - at))
    else:
        origin = draw.randrange(len(content))
        piece = content[origin : origin + length]
        changed[at : at + len(piece)] = piece
    return bytes(changed)


def token(content: bytes, draw: Random) -> bytes:
    """Replace, delete or double a token; move, double or delete a line."""
    kind = draw.randrange(6)
    if kind < 4:
        parts = SEPARATOR.split(content)
        place = draw.randrange(len(parts))
        if draw.random() < 0.4:  # of the head, where the names and units are
            place = min(place, draw.randrange(60))
        value = draw.choice(NUMBERS if draw.random() < 0.6 else WORDS).encode("utf-8", "replace")
        parts[place] = (value, value, b"", parts[place] * 2)[kind]
        return b"".join(parts)
    lines = content.split(b"\n")
    place = draw.randrange(len(lines))
    count = draw.choice((1, 1, 2, len(lines) // 2))
    if kind == 4:
        del lines[place : place + count]
    else:
        to = draw.randrange(len(lines))
        lines[to:to] = lines[place : place + count] * draw.choice((1, 1, 50))
    return b"\n".join(lines)


def json_value(content: bytes, draw: Random) -> bytes:
    """Replace, delete or double one value of a JSON document."""
    try:
        document = json.loads(content)
    except ValueError:
        return byte(content, draw, b"")
    node, trail = document, []
    while isinstance(node, dict | list) and node:
        key: Any = draw.choice(list(node) if isinstance(node, dict) else range(len(node)))
        trail.append((node, key))
        node = node[key]
        if draw.random() < 0.15:
            break
    if not trail:
        return b"[]"
    parent, key = trail[-1]
    kind = draw.randrange(5)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, list):
        parent[key:key] = [parent[key]] * draw.choice((1, 3, 5000))
    elif kind == 2 and isinstance(parent, dict):
        parent[draw.choice(WORDS)] = parent.pop(key)
    else:
        parent[key] = draw.choice(JSON_VALUES)
    text = json.dumps(document)
    if draw.random() < 0.05:
        text = text.replace(draw.choice(text), draw.choice(("\\u0070", "\x00", '"')), 1)
    encoding = draw.choice(("utf-8", "utf-8", "utf-8", "utf-16", "utf-8-sig"))
    return text.encode(encoding, "replace")
