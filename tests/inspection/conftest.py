"""The shipped collapse, with the grid and motion of a measurement, and its inspection."""

import pytest

from granpinn.data import Flow
from granpinn.inspection import Inspection, inspect


@pytest.fixture(scope="session")
def inspected(demo: Flow) -> Inspection:
    return inspect(demo)
