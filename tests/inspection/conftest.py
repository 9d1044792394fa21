"""The shipped collapse, with the grid and motion of a measurement, and its inspection."""

import pytest

from granpinn.data import Flow, read_flow
from granpinn.inspection import Inspection, inspect
from granpinn.simulation import demo_path


@pytest.fixture(scope="session")
def demo() -> Flow:
    return read_flow(demo_path())


@pytest.fixture(scope="session")
def inspected(demo: Flow) -> Inspection:
    return inspect(demo)
