"""A coarser flow than that of other tests: what follows a training takes a third of the time."""

from __future__ import annotations

from pathlib import Path

import pytest

from granpinn.data import Flow, write_flow
from tests.flows import make_flow


@pytest.fixture(scope="session")
def flow() -> Flow:
    return make_flow(frames=6, rows=12, columns=10)


@pytest.fixture(scope="session")
def flow_file(tmp_path_factory: pytest.TempPathFactory, flow: Flow) -> Path:
    path = tmp_path_factory.mktemp("flows") / "heap.h5"
    write_flow(flow, path)
    return path
