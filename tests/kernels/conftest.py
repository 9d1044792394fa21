"""Shared by the kernel tests: the ops under test, and a thread count that a test may change."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import pytest
import torch


@pytest.fixture
def ops() -> ModuleType:
    """granpinn.ops, imported on first use: the oracle's own tests run without compiled kernels."""
    from granpinn import ops

    return ops


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """Gives back the number of threads that the test found."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)
