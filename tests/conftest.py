"""What every test shares: a seed made from the test's own name, and figures without a display."""

import hashlib
import os
import random

os.environ.setdefault("MPLBACKEND", "Agg")

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
