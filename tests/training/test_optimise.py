"""The optimizer against torch's own, on the same gradients, for every member of an ensemble."""

from __future__ import annotations

from itertools import chain
from typing import Any

import pytest
import torch
from torch import Tensor

from granpinn.config import Config, Optimizer, Rheology
from granpinn.kernels.network import n_params, views
from granpinn.physics.laws import DEFAULT
from granpinn.training.law_variables import LawVariables
from granpinn.training.optimise import BETA_1, BatchOptimizer, ParameterGroup, hidden_groups
from granpinn.training.schedule import ControlTable

WIDTHS = (3, 20, 30, 30, 30, 25, 5)
P = n_params(WIDTHS)
E = 3


class Updates:
    """An optimizer with its control on a device, and the calls of a training loop."""

    def __init__(
        self,
        method: Any,
        params: Tensor | None = None,
        device: str | torch.device = "cpu",
        **changes: Any,
    ) -> None:
        if params is None:
            params = torch.randn(E, P, dtype=torch.float64)
        self.params = params.clone().to(device)
        seeds = range(len(params))
        fixed = [{"I0": 0.3}] * len(params)
        self.law = LawVariables([DEFAULT] * len(fixed), Rheology(), fixed, seeds, self.params)
        self.control = ControlTable([lambda _: 1.0] * len(params), Config(), self.params.device)
        self.control.table.fill_(1)
        self.optimizer = BatchOptimizer(
            self.params, self.law, WIDTHS, Optimizer(method=method, **changes), self.control
        )

    def step(self, step: int, law_moves: bool = True) -> None:
        grad_params, grad_theta = (g.to(self.params) for g in gradients(step, len(self.params)))
        self.optimizer.step(self.params.new_zeros(E), grad_params, grad_theta, law_moves)
        assert not self.control.faults()

    def copy(self) -> Updates:
        """Another one in the same state, by its tensors alone."""
        twin = Updates(self.optimizer.settings.method, self.params, self.params.device)
        twin.optimizer.settings = self.optimizer.settings
        twin.law.q.copy_(self.law.q)
        twin.law.theta.copy_(self.law.theta)
        for name, tensor in twin.optimizer.tensors().items():
            tensor.copy_(self.optimizer.tensors()[name])
        return twin


def gradients(step: int, members: int = E) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(step)
    draw = torch.randn(members, P + 3, dtype=torch.float64, generator=generator)
    return draw[:, :-3].contiguous(), draw[:, -3:].contiguous()


def test_adam_is_the_adam_of_torch(device: torch.device) -> None:
    ours = Updates("adam", device=device, learning_rate=1e-3, scalars_learning_rate=1e-2)
    twin = Updates("adam", ours.params.cpu())
    leaves = [twin.params.clone().requires_grad_(), twin.law.q.clone().requires_grad_()]
    rival = torch.optim.Adam(
        [{"params": [leaves[0]], "lr": 1e-3}, {"params": [leaves[1]], "lr": 1e-2}],
        betas=(BETA_1, ours.optimizer.settings.beta_2),
    )
    for step in range(10):
        grad_params, grad_theta = gradients(step)
        leaves[0].grad = grad_params
        (leaves[1].grad,) = torch.autograd.grad(twin.law.theta_of(leaves[1]), leaves[1], grad_theta)
        rival.step()
        ours.step(step)
    torch.testing.assert_close(ours.params.cpu(), leaves[0].detach())
    torch.testing.assert_close(ours.law.q.cpu(), leaves[1].detach())
    torch.testing.assert_close(ours.law.theta.cpu(), twin.law.theta_of(leaves[1].detach()))


@pytest.mark.parametrize("t", [1, 2, 3, 1000, 40_001, 2**20 - 1])
def test_rates_late_in_a_run(t: int, device: torch.device) -> None:
    """Of Adam's update number t, from momenta of zero; the powers in it are made by squaring."""
    one = Updates("adam", device=device, learning_rate=1e-3, scalars_learning_rate=1e-2)
    one.optimizer.counts.fill_(t - 1)
    params, q = one.params.cpu().clone(), one.law.q.cpu().clone()
    law = Updates("adam", one.params.cpu()).law.theta_of
    slope = torch.autograd.functional.jacobian(lambda q: law(q).sum(0), q)
    grad_params, grad_theta = gradients(0)
    grad_q = torch.einsum("keq,ek->eq", slope[:2], grad_theta[:, :2])
    one.step(0)
    s = one.optimizer.settings
    for start, grad, rate, found in (
        (params, grad_params, 1e-3, one.params),
        (q, grad_q, 1e-2, one.law.q),
    ):
        m = (1 - BETA_1) * grad / (1 - BETA_1**t)
        v = (1 - s.beta_2) * grad**2 / (1 - s.beta_2**t)
        expected = -rate * m / (v.sqrt() + s.epsilon)
        torch.testing.assert_close(found.cpu() - start, expected, rtol=1e-9, atol=1e-12)
    assert one.optimizer.counts.tolist() == [[t, t]] * E


def test_muon_is_the_muon_of_torch_up_to_its_bfloat16(device: torch.device) -> None:
    ours = Updates("muon", device=device, muon_learning_rate=0.02, momentum=0.9)
    start = ours.params.cpu().clone()
    moved = [[W for W, _ in views(p, WIDTHS)[1:-1]] for p in start]
    leaves = [[W.clone().requires_grad_() for W in Ws] for Ws in moved]
    rival = torch.optim.Muon([*chain(*leaves)], lr=0.02, momentum=0.9, weight_decay=0.0)
    for step in range(5):
        for Ws, grad in zip(leaves, gradients(step)[0], strict=True):
            for leaf, (G, _) in zip(Ws, views(grad, WIDTHS)[1:-1], strict=True):
                leaf.grad = G
        rival.step()
        ours.step(step)
    for e in range(E):
        change = [W for W, _ in views(ours.params[e].cpu() - start[e], WIDTHS)[1:-1]]
        for mine, leaf, W in zip(change, leaves[e], moved[e], strict=True):
            theirs = leaf.detach() - W
            assert (mine - theirs).norm() < 0.05 * theirs.norm()


def test_muon_leaves_the_first_and_last_layer_and_the_biases_to_adam() -> None:
    muon = Updates("muon")
    adam = Updates("adam", muon.params)
    for one in (muon, adam):
        one.control.table[:, 0] = 0.5
        one.step(0)
    for e in range(E):
        ours, theirs = views(muon.params[e], WIDTHS), views(adam.params[e], WIDTHS)
        for layer in range(6):
            assert torch.equal(ours[layer][1], theirs[layer][1])
            assert torch.equal(ours[layer][0], theirs[layer][0]) is (layer in (0, 5))


def test_hidden_matrices_of_one_shape_are_one_batch() -> None:
    groups = hidden_groups(WIDTHS)
    assert [(g.count, g.m, g.n) for g in groups] == [(1, 30, 20), (2, 30, 30), (1, 25, 30)]
    flat = torch.arange(2.0 * P).view(2, P)
    for e in range(2):
        hidden = [W for W, _ in views(flat[e], WIDTHS)[1:-1]]
        for W, found in zip(hidden, [M for g in groups for M in g.of(flat)[e]], strict=True):
            assert torch.equal(W, found)
    assert hidden_groups((3, 8, 5)) == []
    assert hidden_groups((3, 128, 128, 128, 128, 5)) == [ParameterGroup(512, 3, 128, 128)]


@pytest.mark.parametrize("method", ["adam", "muon"])
def test_a_member_of_an_ensemble_has_the_bits_of_one_alone(method: str) -> None:
    together = Updates(method)
    alone = [Updates(method, together.params[e : e + 1]) for e in range(E)]
    for e, one in enumerate(alone):
        one.law.q.copy_(together.law.q[e])
    for step in range(3):
        grad_params, grad_theta = gradients(step)
        together.step(step)
        for e, one in enumerate(alone):
            own = slice(e, e + 1)
            one.optimizer.step(
                torch.zeros_like(grad_params[own, 0]), grad_params[own], grad_theta[own]
            )
    for e, one in enumerate(alone):
        assert torch.equal(one.params[0], together.params[e])
        assert torch.equal(one.law.theta[0], together.law.theta[e])


FAULTY = {
    "loss": ("loss", "loss"),
    "grad_params": ("gradient of the network parameters", "grad_params"),
    "grad_theta": ("gradient of the friction law", "grad_theta"),
    "params": ("network parameters", "params"),
    "q": ("variables of the friction law", "q"),
    "overflow": ("network parameters", "grad_params"),
}


@pytest.mark.parametrize("case", FAULTY)
@pytest.mark.parametrize("method", ["adam", "muon"])
def test_a_faulty_member_is_frozen_and_the_others_go_on(
    case: str, method: str, device: torch.device
) -> None:
    one = Updates(method, device=device)
    healthy = one.copy()
    name, target = FAULTY[case]
    grad_params, grad_theta = (g.to(device) for g in gradients(0))
    tensors = {
        "loss": torch.zeros(E, 1, dtype=torch.float64, device=device),
        "grad_params": grad_params,
        "grad_theta": grad_theta,
        "params": one.params,
        "q": one.law.q,
    }
    column = 0 if case == "q" else -1  # the last variable is fixed
    tensors[target][1, column] = 1e300 if case == "overflow" else float("nan")
    start = one.params.clone()
    one.optimizer.step(tensors["loss"][:, 0].contiguous(), grad_params, grad_theta)
    assert one.control.faults() == {1: f"the {name} became NaN or infinite in step 1"}
    assert one.control.counter.tolist() == [1, 0, 0]
    if case in ("loss", "grad_theta"):
        assert torch.equal(one.params[1], start[1])
    if case == "grad_params":  # on a GPU the others may have moved
        assert one.params[1, -1] == start[1, -1]
        assert one.params[1].isfinite().all()
    frozen = one.params[1].clone()
    grad_params, grad_theta = (g.to(device) for g in gradients(1))
    one.optimizer.step(tensors["loss"].new_zeros(E), grad_params, grad_theta)
    assert one.control.faults() == {1: f"the {name} became NaN or infinite in step 1"}
    torch.testing.assert_close(one.params[1], frozen, rtol=0, atol=0, equal_nan=True)
    healthy.step(0)
    healthy.step(1)
    for e in (0, 2):
        assert torch.equal(one.params[e], healthy.params[e])
        assert torch.equal(one.law.theta[e], healthy.law.theta[e])
