"""Laws without kernels: the operators in torch are the oracle's, and train the same numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import pytest
import torch
from torch import Tensor

from granpinn import laws, reference
from granpinn.data import Flow
from granpinn.kernels import ops
from granpinn.physics.laws import LAWS
from granpinn.training.operators import COMPILED, IN_TORCH, operators_of
from granpinn.training.trainer import Trainer
from tests.kernels.configurations import problem, small
from tests.runs import make_objective, make_trainer, tiny


def mu_of_i(I: Tensor, theta: Sequence[Tensor]) -> Tensor:
    mu_s, mu_2, I0 = theta
    return mu_s + (mu_2 - mu_s) * I / (I0 + I)


@pytest.fixture
def twin() -> Iterator[laws.Law]:
    """mu(I) as a law of a user, whose I0 is an unknown like the others."""
    parameters = [
        laws.Parameter("mu_s", 0.3),
        laws.Parameter("mu_2", 0.6, above=True),
        laws.Parameter("I0", 0.3),
    ]
    law = laws.Law("twin", mu_of_i, parameters)
    laws.register(law)
    yield law
    del LAWS["twin"]


@pytest.mark.parametrize("law", ["mu_of_i", "coulomb"])
@pytest.mark.parametrize("regime", ["flowing", "low pressure", "slow"])
@pytest.mark.parametrize("walls", [0.0, 0.5])
def test_loss_terms_and_gradients_are_those_of_the_oracle(
    law: str, regime: str, walls: float
) -> None:
    """With a source where there are no side walls."""
    case = problem(small("mixed", law=law, regime=regime, side_wall=walls, source=walls == 0))
    found = IN_TORCH.residual_loss(*case)
    exact = reference.residual_loss(*case)
    for ours, truth in zip(found, exact, strict=True):
        assert ours.abs().max() > 0
        torch.testing.assert_close(ours, truth, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("equations", [True, False])
def test_a_law_of_a_user_is_the_same_law(equations: bool, twin: laws.Law) -> None:
    case = problem(small("mixed", surface_points=5 * equations))
    own = case._replace(law="twin")
    found = IN_TORCH.residual_loss(*own, equations=equations)
    known = ops.residual_loss(*case, equations=equations)
    for ours, truth in zip(found, known, strict=True):
        torch.testing.assert_close(ours, truth, rtol=1e-9, atol=1e-12)
    slow = reference.residual_loss(*own, equations=equations)
    torch.testing.assert_close(slow[0], known[0], rtol=1e-9, atol=1e-12)


def test_viscosity_and_momentum_of_the_fields_are_those_of_the_kernels(twin: laws.Law) -> None:
    case = problem(small("mixed"))
    points, params, theta, *network, physics, _ = case.strong
    jets = ops.network_jet(points, params, *network, 2)
    torch.testing.assert_close(
        IN_TORCH.pointwise_residuals(jets, theta, physics, "strong", "twin"),
        ops.strong_residual(*case.strong),
        rtol=1e-8,
        atol=1e-10,
    )
    rate, p = torch.logspace(-4, 2, 40, dtype=torch.float64), torch.linspace(-0.1, 1, 40).double()
    constants = (0.02, 1e-3, 10.0, 1e-6)
    torch.testing.assert_close(
        IN_TORCH.viscosity(rate, p, case.theta, *constants, "twin"),
        ops.viscosity(rate, p, case.theta, *constants, "mu_of_i"),
    )


def test_the_training_is_the_same_one(flow: Flow, twin: laws.Law) -> None:
    """With the I0 of the kernels, so that both laws have the same unknowns."""
    laws.register(
        laws.Law(
            "twin",
            lambda i, theta: mu_of_i(i, (*theta, torch.full_like(i, 0.3))),
            [laws.Parameter("mu_s", 0.3), laws.Parameter("mu_2", 0.6, above=True)],
        )
    )
    ours, known = (
        trained(make_trainer(tiny(law=name, dtype="float64"), flow)) for name in ("twin", "mu_of_i")
    )
    torch.testing.assert_close(ours[0], known[0], rtol=1e-6, atol=1e-8)
    torch.testing.assert_close(ours[1], known[1][:2], rtol=1e-7, atol=0)


def trained(trainer: Trainer) -> tuple[Tensor, Tensor]:
    """params and theta after all steps and the last layer."""
    while not trainer.finished:
        trainer.advance()
    assert math.isfinite(float(trainer.last.loss)) if trainer.last else False
    trainer.solve_last_layer()
    return trainer.solution()


def test_the_law_chooses_its_operators(flow: Flow, twin: laws.Law) -> None:
    assert operators_of([LAWS["coulomb"]]) is COMPILED
    assert make_objective(tiny(law="twin"), flow).operators is IN_TORCH
    assert operators_of([twin]).captured is False
