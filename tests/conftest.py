"""What tests share: a seed made from the test's own name, a flow, and figures without a display."""

import hashlib
import importlib
import os
import random
import signal
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
if "PYTEST_XDIST_WORKER" in os.environ:  # processes side by side: one thread each
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # Tests of two threads need the other core. Threads that spin would take it from its owner.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numpy as np
import pytest
import torch

from granpinn.data import Flow, read_flow, write_flow
from granpinn.inspection.momentum_balance import Baseline
from tests.flows import make_flow


@pytest.fixture(autouse=True, scope="session")
def interruptible() -> None:
    """Tests and the processes that they start react to Ctrl-C, also where a shell that started
    them in the background ignores it.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Training without the page: its figures have their own tests and take seconds."""
    from tests.commands.pageless import stand_ins  # it loads the command

    for owner, name, value in stand_ins():
        monkeypatch.setattr(owner, name, value)


@pytest.fixture
def no_balance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inspections without the momentum balance: it has its own tests and takes most of the time."""
    balance = importlib.import_module("granpinn.inspection.momentum_balance")
    monkeypatch.setattr(balance, "baseline", lambda *args: Baseline("left out"))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """`figures(*names)`: the page with these figures and those of checks; each takes a second."""
    album = importlib.import_module("granpinn.figures.album")

    def only(*names: str) -> None:
        monkeypatch.setattr(album, "FIGURES", {name: album.FIGURES[name] for name in names})

    return only


@pytest.fixture(scope="session")
def flow() -> Flow:
    return make_flow()


@pytest.fixture(scope="session")
def flow_file(tmp_path_factory: pytest.TempPathFactory, flow: Flow) -> Path:
    path = tmp_path_factory.mktemp("flows") / "heap.h5"
    write_flow(flow, path)
    return path


@pytest.fixture(scope="session")
def demo() -> Flow:
    from granpinn.simulation import demo_path

    return read_flow(demo_path())
