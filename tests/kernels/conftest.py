"""Shared by the kernel tests: the ops under test, and a thread count that a test may change.

The fixture `ops` runs a test once for each device, `pytest -k cuda` picks the GPU's.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import pytest
import torch

from .devices import OnDevice


@pytest.fixture
def cpu_ops() -> ModuleType:
    """granpinn.kernels.ops, imported on first use: the oracle's tests need no compiled kernels."""
    from granpinn.kernels import ops

    return ops


@pytest.fixture
def cuda_ops(cpu_ops: ModuleType) -> ModuleType:
    """granpinn.kernels.ops on the GPU, for tensors of the CPU."""
    from granpinn.kernels import builds

    if not torch.cuda.is_available():
        pytest.skip("torch finds no GPU")
    missing = builds.cuda_missing()
    if missing:
        pytest.skip(f"no CUDA kernels: {missing}")
    return OnDevice(cpu_ops, "cuda")


@pytest.fixture(params=["cpu", "cuda"])
def ops(request: pytest.FixtureRequest) -> ModuleType:
    module: ModuleType = request.getfixturevalue(f"{request.param}_ops")
    return module


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """Gives back the number of threads that the test found."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)
