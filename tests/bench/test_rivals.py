"""The rivals of the GPU benchmark do one and the same step, by other ways of differentiation."""

from __future__ import annotations

import sys

import pytest
import torch

from bench import cache, rivals, steps
from bench.jets import jets_step, taylor_network
from bench.machine import describe
from bench.rivals import Rival
from bench.steps import Task, adam, eager_step, functional_gradient, make_task, nested_loss
from bench.traced import Gradient, nested_gradient, traced

CPU = torch.device("cpu")
FORMS = ["strong", "mixed"]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks of two narrow layers, which are traced quickly."""
    monkeypatch.setattr(steps, "HIDDEN", [7, 5])


@pytest.mark.usefixtures("small")
@pytest.mark.filterwarnings("ignore:.torch.jit.script:DeprecationWarning")
@pytest.mark.parametrize("gradient", [nested_gradient, functional_gradient])
@pytest.mark.parametrize("form", FORMS)
def test_a_traced_gradient_is_that_of_eager_autograd(form: str, gradient: Gradient) -> None:
    task = make_task(form, 8, torch.float64)
    params, theta, _ = adam(task)
    loss = nested_loss(task, params, theta, task.points.clone().requires_grad_())
    expected = (*torch.autograd.grad(loss, (params, theta)), loss.detach())
    graph = traced(gradient, task)
    found = graph(task.params, task.theta, task.points, task.velocity)
    torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-12)
    operations = {str(node.target) for node in graph.graph.nodes}
    assert not {name for name in operations if "efficientzero" in name or "feature_meta" in name}


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("form", FORMS)
def test_jets_of_the_package_are_those_by_hand(form: str) -> None:
    pytest.importorskip("jet", reason="torch-jet is not installed")
    from bench.torch_jet import package_jets

    task = make_task(form, 8, torch.float64)
    params, _, _ = adam(task)
    found = package_jets(task, params)(task.points)
    by_hand = taylor_network(params, task.points, task.widths, len(found))
    torch.testing.assert_close(found, by_hand, rtol=1e-10, atol=1e-12)
    (by_params,) = torch.autograd.grad(found[-1].square().sum(), params)
    (expected,) = torch.autograd.grad(by_hand[-1].square().sum(), params)
    torch.testing.assert_close(by_params, expected, rtol=1e-9, atol=1e-9)
    loss, eager = jets_step(task, jets=package_jets)(), eager_step(task)()
    torch.testing.assert_close(loss, eager, rtol=1e-9, atol=0)


def test_a_package_that_is_missing_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jet", None)
    (rival,) = (rival for rival in rivals.OTHER_RIVALS if rival.name.startswith("torch-jet"))
    assert "jet" in rivals.measure(rival, "strong", 8, CPU).row["error"]


def test_the_command_line_selects_sizes() -> None:
    assert rivals.chosen(rivals.SIZES, None, None) == rivals.SIZES
    assert rivals.chosen(rivals.SIZES, "strong", [512, 4096]) == {"strong": (512, 4096)}


def test_slow_compilers_have_few_rows() -> None:
    (slow, _), (quick, *_) = rivals.SLOW_RIVALS, rivals.GRANPINN
    assert [slow.wants("strong", n) for n in (512, 32768, 262144)] == [True, True, False]
    assert not slow.wants("mixed", 32768)
    assert quick.wants("mixed", 262144)


def test_what_stays_from_step_to_step() -> None:
    task: Task = make_task("strong", 16)
    tensors = 4 * (task.params.numel() + task.theta.numel()) + task.points.numel()
    assert task.resident == 4 * (tensors + task.velocity.numel())
    row = rivals.measure(Rival("eager", eager_step, False), "strong", 16, CPU).row
    assert row["resident_mb"] == task.resident / 1e6
    assert "ms_alone_cold" not in row  # a CPU has no cache to overwrite here
    assert cache.cache_bytes(CPU) is None


def test_a_benchmark_states_the_processor() -> None:
    assert len(describe()["processor"]) > 3
