"""Gate F-2: a mutant of a valid file is either read or refused with a FlowFileError."""

from __future__ import annotations

import warnings
from pathlib import Path
from random import Random

import pytest

from bench.studies.reliability.damage import damaged
from granpinn.data import FlowFileError, FlowFileWarning, check_flow, read_flow, write_flow
from tests.flows import make_flow


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
        path.write_bytes(damaged(content, Random(seed), content))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FlowFileWarning)
            try:
                flow = read_flow(path)
            except FlowFileError:
                refused += 1
            else:
                check_flow(flow)
    assert 0.3 < refused / count < 0.9, "the mutants should be neither all fatal nor all harmless"
