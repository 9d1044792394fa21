"""V-1 for the oracle: manufactured fields through both residual forms against sympy."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from granpinn import reference

from .manufactured import FIELDS, PHYSICS, THETA, manufactured

POINTS = 10_000
FORMS = ("strong", "mixed")


def worst_relative_error(got: torch.Tensor, exact: np.ndarray) -> float:
    """Largest error of each residual over its root mean square, over all residuals."""
    error = np.abs(got.detach().numpy() - exact).max(axis=0)
    return float((error / np.sqrt((exact**2).mean(axis=0))).max())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", FIELDS)
def test_residuals_of_manufactured_fields(name: str, form: str) -> None:
    case = manufactured(name, form)
    points = case.points(POINTS)
    theta = torch.tensor(THETA, dtype=torch.float64)
    got = reference.residuals(case.raw_network(), torch.from_numpy(points), theta, PHYSICS, form)
    assert worst_relative_error(got, case.residuals(points)) <= 1e-12


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", FIELDS)
def test_residuals_from_raw_jets_of_manufactured_fields(name: str, form: str) -> None:
    case = manufactured(name, form)
    points = case.points(POINTS)
    theta = torch.tensor(THETA, dtype=torch.float64)
    got = reference.pointwise_residuals(case.raw_jets(points), theta, PHYSICS, form)
    assert worst_relative_error(got, case.residuals(points)) <= 1e-12
