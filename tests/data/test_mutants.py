"""Gate F-2: a mutant of a valid file is either read or refused with a FlowFileError."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import pytest

from granpinn.data import FlowFileError, FlowFileWarning, check_flow, read_flow, write_flow
from tests.flows import make_flow

# Where the structure of the file is, mostly: half of all changes go there.
START = 16_000


def mutant(content: bytes, seed: int) -> bytes:
    """The file with up to 40 places changed, or cut off."""
    draw = random.Random(seed)
    if draw.random() < 0.05:
        return content[: draw.randrange(len(content))]
    changed = bytearray(content)
    for _ in range(draw.choice([1, 1, 1, 2, 3, 8, 40])):
        place = draw.randrange(draw.choice([len(content), START]))
        kind = draw.randrange(4)
        if kind == 0:
            changed[place] ^= 1 << draw.randrange(8)
        elif kind == 1:
            changed[place] = draw.choice([0, 1, 127, 128, 255, draw.randrange(256)])
        elif kind == 2:
            length = draw.choice([2, 4, 8])
            changed[place : place + length] = bytes([draw.choice([0, 255])]) * length
        else:
            origin, length = draw.randrange(len(content)), draw.randrange(1, 64)
            changed[place : place + length] = changed[origin : origin + length]
    return bytes(changed[: len(content)])


@pytest.mark.parametrize(
    ("first", "count"),
    [(0, 500), pytest.param(1000, 10_000, marks=[pytest.mark.long, pytest.mark.timeout(600)])],
)
def test_mutants(first: int, count: int, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(make_flow(), path)
    content = path.read_bytes()
    refused = 0
    for seed in range(first, first + count):
        path.write_bytes(mutant(content, seed))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FlowFileWarning)
            try:
                flow = read_flow(path)
            except FlowFileError:
                refused += 1
            else:
                check_flow(flow)
    assert 0.3 < refused / count < 0.9, "the mutants should be neither all fatal nor all harmless"
