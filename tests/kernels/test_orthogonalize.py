"""The orthogonal factor of Muon against the same iteration in plain float64 products."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from granpinn.training import step_ops  # noqa: F401

SHAPES = [(128, 128), (33, 31), (20, 50), (50, 20), (1, 5), (7, 7), (250, 130)]
# On a GPU with clusters float32 takes another way above a side of 128 or 1000 matrices, and shares
# a matrix between more blocks above a smaller side of 32 and of 64.
EDGES = [(1, 1), (32, 32), (40, 128), (64, 64), (65, 64), (127, 90), (127, 127), (128, 127)]
EDGES += [(128, 40), (128, 129), (250, 250), (256, 256), (300, 257)]


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


@pytest.mark.parametrize("shape", SHAPES + EDGES)
def test_it_errs_like_plain_float32(shape: tuple[int, int], device: torch.device) -> None:
    G = torch.randn(3, *shape)
    truth = newton_schulz(G.double())
    rival = (newton_schulz(G) - truth).norm()
    assert (orthogonalize(G, device) - truth).norm() <= 2 * rival + 1e-7 * truth.norm()


@pytest.mark.parametrize("count", [40, 999, 1000, 1001])
def test_many_matrices(count: int, device: torch.device) -> None:
    shape = (128, 128) if count == 40 else (20, 24)
    G = torch.randn(count, *shape) * torch.logspace(-15, 15, count)[:, None, None]
    truth = newton_schulz(G.double())
    rival = (newton_schulz(G) - truth).norm()
    assert (orthogonalize(G, device) - truth).norm() <= 2 * rival + 1e-7 * truth.norm()


@pytest.mark.parametrize("shape", [(128, 128), (40, 100), (20, 16)])
def test_it_repeats_itself(shape: tuple[int, int], device: torch.device) -> None:
    G = torch.randn(30, *shape)
    first = orthogonalize(G, device)
    assert torch.equal(first, orthogonalize(G, device))
    assert torch.equal(first[7], orthogonalize(G[7], device))


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


@pytest.mark.parametrize("kind", ["columns", "parameters"])
def test_matrices_of_a_batch_do_not_touch_each_other(kind: str, device: torch.device) -> None:
    if kind == "columns":
        G = torch.randn(2, 3, 40, 50).to(device)[..., :33]
    else:  # of two members, each matrix followed by other parameters: aligned to 4 bytes only
        params = torch.randn(2, 5003).to(device)
        G = params.as_strided((2, 3, 40, 33), (5003, 1321, 33, 1), 1)
    together = orthogonalize(G, device)
    for e in range(2):
        for k in range(3):
            assert torch.equal(together[e, k], orthogonalize(G[e, k], device))


def test_the_number_of_threads_changes_no_bit(threads: None) -> None:
    G = torch.randn(5, 64, 64)
    expected = orthogonalize(G)
    for count in (1, 2, 3):
        torch.set_num_threads(count)
        assert torch.equal(orthogonalize(G), expected)
