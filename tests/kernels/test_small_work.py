"""Every CUDA kernel once, on little work, for compute-sanitizer (bench/sanitize.sh, K-6).

No graph, no oracle on the GPU, few kernels of torch: the tools make each launch a hundred times
slower. The sizes are odd, so that the last tile, warp and vector are not full.
"""

from __future__ import annotations

from types import ModuleType

import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.config import Config
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.physics.laws import DEFAULT, LAWS
from granpinn.training.objective import Member, Objective
from granpinn.training.optimise import ParameterGroup
from granpinn.training.points import training_set
from granpinn.training.problem import build
from granpinn.training.schedule import HEALTHY, Schedule
from granpinn.training.trainer import Trainer
from tests.flows import make_flow

from .accuracy import EPSILON, GROSS_FACTOR
from .configurations import problem, small
from .devices import moved

pytestmark = pytest.mark.cuda

TF32 = 2.0**-11  # unit roundoff of the backward products of the mode "fast", and of half precision

# Points that make the tiles large (csrc/cuda/fused/fused_loss.cu, on 132 multiprocessors).
MANY = {"mixed": 2203, "strong": 1103, "data": 8501}


# Forms, laws, and members of those that have a source.
LOSSES = [(form, law, None) for form in ("mixed", "strong") for law in LAWS]
SOURCED = [(form, law, 2) for form in ("mixed", "strong") for law in ("mu_of_i", "power")]


@pytest.mark.parametrize("precision", ["fp32", "fast"])
@pytest.mark.parametrize(("form", "law", "sourced"), [*LOSSES, ("data", "mu_of_i", None), *SOURCED])
@pytest.mark.parametrize(
    ("hidden", "points"),
    [((33, 40), 37), ((201, 250), 37), ((201, 250), None)],
    ids=["narrow", "wide", "large tiles"],
)
def test_fused_loss(
    hidden: tuple[int, ...],
    points: int | None,
    form: str,
    law: str,
    sourced: int | None,
    precision: str,
    cuda_ops: ModuleType,
) -> None:
    """Float32 within `GROSS_FACTOR` of float32 autograd, or of TF32 where products are that."""
    network = "strong" if form == "strong" else "mixed"
    sizes = {"points": points or MANY[form], "surface_points": 19, "hidden": hidden}
    source = {"members": sourced, "source": sourced is not None}
    case = problem(small(network, law=law, **source, **sizes))
    low, equations = case.to(torch.float32), form != "data"
    loss, _, grad_params, _ = cuda_ops.residual_loss(*low, precision=precision, equations=equations)
    exact = reference.residual_loss(*case, equations=equations)
    yardstick = reference.residual_loss(*low, equations=equations)
    for index, found, unit in (
        (0, loss, EPSILON),
        (2, grad_params, TF32 if precision == "fast" else EPSILON),
    ):
        autograd = relative(yardstick[index], exact[index])
        assert relative(found, exact[index]) <= GROSS_FACTOR * max(unit, autograd)


@pytest.mark.parametrize("members", [None, 3])
@pytest.mark.parametrize(
    ("dtype", "hidden"), [(torch.float64, (17, 8)), (torch.float32, (301,))], ids=str
)
@pytest.mark.parametrize(("form", "law", "sourced"), [*LOSSES, *SOURCED])
def test_layered_loss(
    form: str,
    law: str,
    sourced: int | None,
    dtype: torch.dtype,
    hidden: tuple[int, ...],
    members: int | None,
    cuda_ops: ModuleType,
) -> None:
    """float64, and layers that the fused kernels do not take."""
    source = {"source": sourced is not None, "members": members}
    case = problem(small(form, law=law, hidden=hidden, **source))
    found = cuda_ops.residual_loss(*case.to(dtype))
    exact = reference.residual_loss(*case)
    yardstick = reference.residual_loss(*case.to(dtype))
    for index in (0, 2):
        autograd = relative(yardstick[index], exact[index])
        unit = torch.finfo(dtype).eps
        assert relative(found[index], exact[index]) <= GROSS_FACTOR * max(unit, autograd)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_jet_and_its_gradient(order: int, cuda_ops: ModuleType) -> None:
    case = problem(small("mixed", members=2))
    network = (case.batch.points, case.params.requires_grad_(), *case.network[2:])
    found, exact = (
        torch.autograd.grad(ops.network_jet(*network, order).square().sum(), case.params)[0]
        for ops in (cuda_ops, torch_ops())
    )
    torch.testing.assert_close(found, exact, rtol=1e-9, atol=1e-11 * float(exact.abs().max()))


def torch_ops() -> ModuleType:
    """The same operators on the CPU, which the other tests hold to the oracle."""
    from granpinn.kernels import ops

    return ops


def test_pointwise_kernels(cuda_ops: ModuleType) -> None:
    case = problem(small("strong"))
    found = cuda_ops.strong_residual(*case.strong)
    torch.testing.assert_close(found, torch_ops().strong_residual(*case.strong), rtol=1e-9, atol=0)
    for law in LAWS.values():
        theta = torch.tensor([p.start for p in law.parameters], dtype=torch.float64)
        leaves = [torch.linspace(0, 1, 41).double(), torch.linspace(-0.1, 1, 41).double(), theta]
        both = []
        for ops in (cuda_ops, torch_ops()):
            inputs = [x.clone().requires_grad_() for x in leaves]
            eta = ops.viscosity(*inputs, 0.02, 1e-3, 1e3, 1e-4, law.name)
            both.append([eta, *torch.autograd.grad(eta.sum(), inputs)])
        torch.testing.assert_close(*both, rtol=1e-9, atol=1e-12)
    drawn = cuda_ops.sample_indices(5, 7, 1, 41, 1000)
    assert torch.equal(drawn, torch_ops().sample_indices(5, 7, 1, 41, 1000))


@pytest.mark.parametrize("shape", [(3, 33, 31), (2, 128, 128), (1, 250, 250)], ids=str)
def test_newton_schulz(shape: tuple[int, ...], cuda_ops: ModuleType) -> None:
    G = torch.randn(shape, dtype=torch.float64)
    orthogonalize = torch.ops.granpinn.orthogonalize
    for dtype in (torch.float64, torch.float32):
        found = orthogonalize(moved(G.to(dtype), "cuda")).cpu().double()
        unit = torch.finfo(dtype).eps
        assert relative(found, orthogonalize(G)) <= GROSS_FACTOR * shape[-1] * unit
    fast = orthogonalize(moved(G.float(), "cuda"), "fast").cpu()
    assert relative(fast, orthogonalize(G)) <= GROSS_FACTOR * TF32


@pytest.mark.parametrize("shape", [(2, 33, 31), (1, 128, 128)], ids=str)
def test_descent_in_one_launch(shape: tuple[int, int, int], cuda_ops: ModuleType) -> None:
    """Two members, one of them frozen."""
    group = ParameterGroup(3, *shape)
    params, direction = torch.randn(2, 2, 5 + group.count * group.apart)
    counter, counts = torch.tensor([1, 0, 0]), torch.zeros(2, 2, dtype=torch.int64)
    table, lr_scale = torch.ones(1, 3, dtype=torch.float64), torch.ones(2, dtype=torch.float64)
    places = (group.offset, group.apart, 1.0, "fast")
    state = (counter, table, lr_scale, torch.tensor([HEALTHY, 0]), counts)
    moves = {}
    for device in ("cpu", "cuda"):
        G, now = group.of(direction.to(device)), params.to(device, copy=True)
        there = (tensor.to(device) for tensor in state)
        torch.ops.granpinn.descend(*there, G, now, *places)
        moves[device] = now.cpu() - params
    assert not moves["cpu"][1].any()
    assert not moves["cuda"][1].any()
    assert relative(moves["cuda"][0], moves["cpu"][0].double()) <= GROSS_FACTOR * TF32


@pytest.mark.parametrize("method", ["muon", "adam"])
def test_steps_of_a_training(method: str, cuda_ops: ModuleType) -> None:
    """Batch, loss, check, update, orthogonal factor and the rest of the step: five of them."""
    cpu, cuda = (after_steps(device, method, steps=5) for device in ("cpu", "cuda"))
    for name, expected in cpu.items():
        torch.testing.assert_close(cuda[name].cpu(), expected, rtol=1e-7, atol=1e-9)


def after_steps(device: str, method: str, steps: int) -> dict[str, Tensor]:
    """The state of three members after steps that were called, not captured; float64."""
    config = Config(
        steps=40,
        dtype="float64",
        network__widths=(17, 17, 9),
        batch__interior=33,
        batch__surface=6,
        optimizer__method=method,
    )
    flow = make_flow()
    scales = scales_of(flow)
    data = training_set(flow, scales, config.level, torch.float64)
    posed = build(Facts(flow, scales), data, config)
    members = [Member(posed, data, seed, DEFAULT, {"I0": config.I0}) for seed in (0, 1, 2)]
    objective = Objective(members, config.batch, torch.device(device))
    trainer = Trainer(objective, Schedule(40, config.optimizer), config)
    at = trainer.schedule, 0, trainer.misfit
    trainer.control.prepare(*at, steps, trainer.lr_scale, trainer.diverged)
    with torch.no_grad():
        for step in range(steps):
            trainer.one_step(prefit=step < 2)
    assert trainer.control.fault.tolist() == [HEALTHY] * 3
    return trainer.tensors()


def relative(found: Tensor, exact: Tensor) -> float:
    return float((found.double() - exact).norm() / exact.norm())
