"""The orthogonal factor of Muon against the same iteration in plain float64 products."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from granpinn import step_ops  # noqa: F401

SHAPES = [(128, 128), (33, 31), (20, 50), (50, 20), (1, 5), (7, 7), (250, 130)]


def newton_schulz(G: Tensor) -> Tensor:
    """Jordan et al. (2024), as they write it."""
    a, b, c = 3.4445, -4.7750, 2.0315
    X = G / torch.linalg.matrix_norm(G, keepdim=True)
    if tall := G.shape[-2] > G.shape[-1]:
        X = X.mT
    for _ in range(5):
        A = X @ X.mT
        X = a * X + (b * A + c * A @ A) @ X
    return X.mT if tall else X


def orthogonalize(G: Tensor, device: str | torch.device = "cpu") -> Tensor:
    result: Tensor = torch.ops.granpinn.orthogonalize(G.to(device))
    return result.cpu()


@pytest.mark.parametrize("shape", SHAPES)
def test_it_errs_like_plain_float32(shape: tuple[int, int], device: torch.device) -> None:
    G = torch.randn(3, *shape)
    truth = newton_schulz(G.double())
    rival = (newton_schulz(G) - truth).norm()
    assert (orthogonalize(G, device) - truth).norm() <= 2 * rival + 1e-7 * truth.norm()


@pytest.mark.parametrize("shape", SHAPES)
def test_it_is_the_published_iteration(shape: tuple[int, int], device: torch.device) -> None:
    """A rounding error grows as a small singular value does: at most by 3.4445 in a step."""
    G = torch.randn(3, *shape, dtype=torch.float64)
    truth = newton_schulz(G)
    eps = torch.finfo(torch.float64).eps
    assert (orthogonalize(G, device) - truth).norm() <= 3.4445**5 * eps * truth.norm()


@pytest.mark.parametrize("shape", [(30, 30), (20, 50), (50, 20)])
def test_singular_values_become_about_one(shape: tuple[int, int]) -> None:
    X = orthogonalize(torch.randn(shape, dtype=torch.float64))
    values = torch.linalg.svdvals(X)
    assert X.shape == shape
    assert values.max() < 1.3
    assert values.median() > 0.6


def test_zero_stays_zero_and_nothing_stays_nothing(device: torch.device) -> None:
    assert not orthogonalize(torch.zeros(4, 4), device).any()
    assert orthogonalize(torch.zeros(0, 4, 4), device).shape == (0, 4, 4)
    assert orthogonalize(torch.zeros(2, 0, 4), device).shape == (2, 0, 4)


def test_matrices_of_a_batch_do_not_touch_each_other() -> None:
    wide = torch.randn(2, 3, 40, 50)
    G = wide[..., :33]  # strided
    together = orthogonalize(G)
    for e in range(2):
        for k in range(3):
            assert torch.equal(together[e, k], orthogonalize(G[e, k]))


def test_the_number_of_threads_changes_no_bit(threads: None) -> None:
    G = torch.randn(5, 64, 64)
    expected = orthogonalize(G)
    for count in (1, 2, 3):
        torch.set_num_threads(count)
        assert torch.equal(orthogonalize(G), expected)
