"""Damaged copies of a file, each a pure function of a seed and a number."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np

Random = np.random.Generator

# fmt: off
HOSTILE = (
    b"", b"nan", b"inf", b"-inf", b"-0", b"0", b"1", b"-1", b"1e400", b"-1e400", b"1e300", b"1e30",
    b"1e-320", b"5e-324", b"0x10", b"1_000", b"1e", b"--1", b"9" * 5000, b"0." + b"0" * 99,
    b"2147483648", b"18446744073709551616", b"\xd9\xa1\xd9\xa2", b"\xff\xfe", b"\0", b'"',
    b"\xe2\x80\xae", b"\x1b[31m", b"[", b"(", b"1/0", b"a" * 200_000, b" " * 200_000, b"1," * 5000,
    b"$\\frac{", b"m**9**9", b"1e999 m",
)
# fmt: on
_TOKEN = re.compile(rb"[^\s,;\[\]\"=]+")


def mutants(content: bytes, seed: int, count: int, start: int = 0) -> Iterator[tuple[str, bytes]]:
    """Damaged copies number `start` to `start + count`, each with the name of its damage.

    Args:
        content: of a valid file; the text kinds of damage expect lines.
        seed: of the whole series.
    """
    kinds = list(KINDS)
    for k in range(start, start + count):
        rng = np.random.default_rng([seed, k])
        name = kinds[k % len(kinds)]
        yield f"{name} {k}", KINDS[name](content, rng)


def _flipped(content: bytes, rng: Random) -> bytes:
    """A few bytes changed."""
    damaged = bytearray(content)
    for at in rng.integers(len(damaged), size=rng.integers(1, 5)):
        damaged[at] ^= int(rng.integers(1, 256))
    return bytes(damaged)


def _cut(content: bytes, rng: Random) -> bytes:
    return content[: rng.integers(1, len(content))]


def _piece(content: bytes, rng: Random) -> bytes:
    """A piece left out, or there twice."""
    at, length = int(rng.integers(len(content))), int(rng.integers(1, 400))
    twice = rng.random() < 0.5
    return content[: at + length * twice] + content[at + length * (not twice) :]


def _token(content: bytes, rng: Random) -> bytes:
    """One token replaced by a hostile one, often in the first lines."""
    tokens = list(_TOKEN.finditer(content))
    early = max(1, min(len(tokens), 40))
    found = tokens[int(rng.integers(early if rng.random() < 0.5 else len(tokens)))]
    return content[: found.start()] + _hostile(rng) + content[found.end() :]


def _column(content: bytes, rng: Random) -> bytes:
    """One token of every line replaced by the same hostile one."""
    place, token = int(rng.integers(6)), _hostile(rng)
    lines = []
    for line in content.split(b"\n"):
        tokens = list(_TOKEN.finditer(line))
        if len(tokens) > place:
            found = tokens[place]
            line = line[: found.start()] + token[:200] + line[found.end() :]
        lines.append(line)
    return b"\n".join(lines)


def _lines(content: bytes, rng: Random) -> bytes:
    """Lines left out, repeated, shuffled or reversed."""
    lines = content.split(b"\n")
    at, length = int(rng.integers(len(lines))), int(rng.integers(1, 20))
    kind = rng.integers(6)
    if kind == 0:
        del lines[at : at + length]
    elif kind == 1:
        lines[at:at] = lines[at : at + length]
    elif kind == 2:
        head = int(rng.integers(4))
        lines[head:] = [lines[i] for i in head + rng.permutation(len(lines) - head)]
    elif kind == 3:
        lines.reverse()
    elif kind == 4:
        lines = lines[: int(rng.integers(1, 5))]
    else:
        lines = lines[:1] + lines[at : at + 2]
    return b"\n".join(lines)


def _coded(content: bytes, rng: Random) -> bytes:
    """Another encoding or other line ends."""
    ends = (b"\r", b"\r\n", b"", b" ", b"\n\n", b"\x0b", b"\x85")
    kind = int(rng.integers(len(ends) + 2))
    if kind < len(ends):
        return content.replace(b"\n", ends[kind])
    text = content.decode("utf-8", "replace")
    return text.encode("utf-16" if kind == len(ends) else "utf-32")


def _hostile(rng: Random) -> bytes:
    return HOSTILE[int(rng.integers(len(HOSTILE)))]


KINDS: dict[str, Callable[[bytes, Random], bytes]] = {
    "flip": _flipped,
    "cut": _cut,
    "piece": _piece,
    "token": _token,
    "column": _column,
    "lines": _lines,
    "coded": _coded,
    "second token": _token,
}
