"""V-1 for the oracle: manufactured fields through both residual forms against sympy."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from granpinn import reference
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.terms import LossPoints

from .configurations import Form, problem, small
from .manufactured import CASES, PHYSICS, exact, manufactured

POINTS = 10_000
FORMS = ("strong", "mixed")


def worst_relative_error(got: torch.Tensor, exact: np.ndarray) -> float:
    """Largest error of each residual over its root mean square, over all residuals."""
    error = np.abs(got.detach().numpy() - exact).max(axis=0)
    return float((error / np.sqrt((exact**2).mean(axis=0))).max())


@pytest.mark.parametrize(("name", "law"), CASES)
@pytest.mark.parametrize("form", FORMS)
def test_residuals_of_manufactured_fields(name: str, form: str, law: str) -> None:
    """By differentiation of the network, and from its raw jets."""
    case = manufactured(name, form, law)
    points, truth = exact(name, form, law, POINTS)
    where = torch.from_numpy(points)
    constants = (case.theta, PHYSICS, form, law)
    for got in (
        reference.residuals(case.raw_network(), where, *constants),
        reference.pointwise_residuals(case.raw_jets(points), *constants),
    ):
        assert worst_relative_error(got, truth) <= 1e-12


@pytest.mark.parametrize("form", FORMS)
def test_a_source_of_their_residuals_leaves_none(form: str) -> None:
    """The force of the momentum equation beside gravity; the other residuals stay."""
    case = manufactured("waves", form)
    points, truth = exact("waves", form, "mu_of_i", POINTS)
    where, source = torch.from_numpy(points), torch.from_numpy(truth[:, :2].astype(float))
    constants = (case.theta, PHYSICS, form)
    found = reference.residuals(case.raw_network(), where, *constants, source=source).detach()
    assert float(found[:, :2].abs().max()) <= 1e-12 * float(source.abs().max())
    others = torch.from_numpy(truth[:, 2:].astype(float))
    torch.testing.assert_close(found[:, 2:], others, rtol=1e-9, atol=1e-12)


def test_jet_of_an_affine_network_by_hand() -> None:
    """Without a hidden layer the network is affine: constant slopes, no curvature."""
    params = torch.arange(12, dtype=torch.float64)  # W [3, 3] = 0..8, b = 9, 10, 11
    points = torch.tensor([[1.0, 2.0, 3.0]], dtype=torch.float64)
    shift, scale = [0.5, 0.0, 1.0], [2.0, 1.0, 0.5]
    jet = reference.network_jet(points, params, [3, 3], shift, scale, 2)
    z = [[9 + 0 * 1 + 1 * 2 + 2 * 1, 10 + 3 * 1 + 4 * 2 + 5 * 1, 11 + 6 * 1 + 7 * 2 + 8 * 1]]
    slopes = [[[0.0, 6.0, 12.0]], [[1.0, 4.0, 7.0]], [[1.0, 2.5, 4.0]]]
    expected = torch.zeros(7, 1, 3, dtype=torch.float64)
    expected[0], expected[1:4] = torch.tensor(z), torch.tensor(slopes)
    torch.testing.assert_close(jet, expected)


@pytest.mark.parametrize("form", FORMS)
def test_gradient_of_the_loss_against_differences(form: Form) -> None:
    case = problem(small(form))
    _, _, *gradients = reference.residual_loss(*case)
    rng = torch.Generator().manual_seed(1)
    for name, gradient in zip(("params", "theta"), gradients, strict=True):
        direction = torch.randn(gradient.shape, generator=rng, dtype=torch.float64)
        h = 1e-6

        at = getattr(case, name)
        ahead, behind = (
            reference.residual_loss(*case._replace(**{name: at + step * direction}))[0]
            for step in (h, -h)
        )
        difference = (ahead - behind) / (2 * h)
        torch.testing.assert_close(gradient @ direction, difference, rtol=1e-6, atol=1e-8)


def test_terms_by_hand() -> None:
    """A network of zero weights: fields are its biases, and every term can be written down."""
    b = torch.tensor([0.3, -0.2, 0.0, 0.5, 0.1], dtype=torch.float64)
    params = torch.cat([torch.zeros(15, dtype=torch.float64), b])
    U, P, g_x, g_y = 2.0, 0.5, 0.6, -0.8
    physics = [0.02, g_x, g_y, 0.0, 1e4, U, P, 1e-4, math.inf, 0.25, 0.3, 0.5]
    p = P * np.log(2)  # softplus(0)
    theta = torch.tensor([0.375, 0.6875, 0.28125], dtype=torch.float64)
    none = torch.zeros(2, 3, dtype=torch.float64)
    batch = LossPoints(
        points=none,
        velocity=torch.tensor([[0.6, -0.2], [0.0, 0.0]], dtype=torch.float64),
        point_weights=torch.tensor([[1.0, 1.0], [0.5, 3.0]], dtype=torch.float64),
        surface_points=none,
        surface_pressure=none[:, 0],
    )
    spec = NetworkSpec((3, 5), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), "mixed")
    terms = reference.loss_terms(params, theta, batch, spec, physics)
    velocity = 0.5 * (0.6**2 + 0.2**2) / 4
    friction = 0.25 * p / math.sqrt(0.6**2 + 0.2**2 + 0.3**2)
    forces = (g_x - friction * 0.6, g_y + friction * 0.2)
    momentum = (1 + 3) * (forces[0] ** 2 + forces[1] ** 2) / 4
    expected = torch.tensor([velocity, p**2 / 2, momentum, 0.0, 0.0], dtype=torch.float64)
    torch.testing.assert_close(terms, expected, rtol=1e-12, atol=1e-11)
