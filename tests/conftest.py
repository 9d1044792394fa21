"""Shared by all tests: a seed made from the name of the test, and figures without a display."""

import hashlib
import importlib
import os
import random

os.environ.setdefault("MPLBACKEND", "Agg")
if "PYTEST_XDIST_WORKER" in os.environ:  # processes side by side: one thread each
    os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pytest
import torch


@pytest.fixture(autouse=True)
def seed(request: pytest.FixtureRequest) -> int:
    """Seeds random, NumPy and torch from the test id: the same draws alone and in any order."""
    value = int.from_bytes(hashlib.sha256(request.node.nodeid.encode()).digest()[:4], "big")
    random.seed(value)
    np.random.seed(value)  # noqa: NPY002 - code under test may use the global state
    torch.manual_seed(value)
    return value


@pytest.fixture(params=["cpu", "cuda"])
def device(request: pytest.FixtureRequest) -> torch.device:
    """Each device in turn; a GPU where there is one and kernels for it were built."""
    name = str(request.param)
    if name == "cuda":
        importlib.import_module("granpinn.kernels.ops")
        operator = "granpinn::draw_batch"
        if not torch._C._dispatch_has_kernel_for_dispatch_key(operator, "CUDA"):
            pytest.skip("granpinn was built without CUDA kernels")
        if not torch.cuda.is_available():
            pytest.skip("torch finds no GPU")
    return torch.device(name)
