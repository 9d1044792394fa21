"""The orthogonal factor of Muon against the same iteration in plain float64 products."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest
import torch
from torch import Tensor

from granpinn.kernels import step_ops  # noqa: F401

SHAPES = [(128, 128), (33, 31), (20, 50), (50, 20), (1, 5), (7, 7), (250, 130)]
# On a GPU with clusters float32 takes another way above a side of 128 or 1000 matrices, and shares
# a matrix between more blocks above a smaller side of 32 and of 64.
EDGES = [(1, 1), (32, 32), (40, 128), (64, 64), (65, 64), (127, 90), (127, 127), (128, 127)]
EDGES += [(128, 40), (128, 129), (250, 250), (256, 256), (300, 257)]

# Shapes that "fast" takes in half precision, by their size k = 1, 2, ... 128.
FAMILIES: dict[str, Callable[[int], tuple[int, int]]] = {
    "wide": lambda k: (k, 128),
    "tall": lambda k: (128, k),
    "square": lambda k: (k, k),
    "row": lambda k: (1, k),
    "narrow": lambda k: (k, 7),
}
WIDEST = 5e-3  # relative error of "fast" for sides of 64 and more
BFLOAT16 = 2e-2  # what bfloat16, in which Muon is published, costs at least


def same(X: Tensor) -> Tensor:
    return X


def rounded_to_half(X: Tensor) -> Tensor:
    return X.half().to(X.dtype)


def newton_schulz(G: Tensor, operand: Callable[[Tensor], Tensor] = same) -> Tensor:
    """Jordan et al. (2024), as they write it, with operands of products that may be rounded."""
    a, b, c = 3.4445, -4.7750, 2.0315
    X = G / torch.linalg.matrix_norm(G, keepdim=True)
    if tall := G.shape[-2] > G.shape[-1]:
        X = X.mT
    for _ in range(5):
        right = operand(X)
        A = right @ right.mT
        P = b * A + c * operand(A) @ operand(A)
        X = a * X + operand(P) @ right
    return X.mT if tall else X


def orthogonalize(G: Tensor, device: str | torch.device = "cpu", precision: str = "fp32") -> Tensor:
    result: Tensor = torch.ops.granpinn.orthogonalize(G.to(device), precision)
    return result.cpu()


@pytest.mark.parametrize("shape", SHAPES + EDGES)
def test_it_errs_like_plain_float32(shape: tuple[int, int], device: torch.device) -> None:
    G = torch.randn(3, *shape)
    truth = newton_schulz(G.double())
    rival = (newton_schulz(G) - truth).norm()
    assert (orthogonalize(G, device) - truth).norm() <= 2 * rival + 1e-7 * truth.norm()


def relative(found: Tensor, truth: Tensor) -> float:
    return float((found - truth).norm() / truth.norm())


@pytest.mark.parametrize("family", FAMILIES)
def test_fast_errs_like_half_precision(family: str, cuda_ops: ModuleType) -> None:
    """A family is one vector: a small matrix has few rounding errors, small or large by luck."""
    truths, found, rivals = [], [], []
    for k in range(1, 129):
        G = torch.randn(3, *FAMILIES[family](k))
        truth, fast = newton_schulz(G.double()), orthogonalize(G, "cuda", "fast")
        assert relative(fast, truth) <= (WIDEST if min(G.shape[1:]) >= 64 else BFLOAT16), k
        truths.append(truth.flatten())
        found.append(fast.flatten())
        rivals.append(newton_schulz(G, rounded_to_half).flatten())
    truth, fast, rival = (torch.cat(parts) for parts in (truths, found, rivals))
    assert relative(fast, truth) <= 2 * relative(rival, truth)


@pytest.mark.parametrize("decay", [2, 4, 8])
def test_fast_with_small_singular_values(decay: int, cuda_ops: ModuleType) -> None:
    """They are amplified most, and must not drown in what the large ones round to."""
    U, V = (torch.linalg.qr(torch.randn(3, 128, 128))[0] for _ in range(2))
    G = (U * torch.logspace(0, -decay, 128)) @ V
    truth = newton_schulz(G.double())
    rival = relative(newton_schulz(G, rounded_to_half), truth)
    assert relative(orthogonalize(G, "cuda", "fast"), truth) <= min(2 * rival, WIDEST)


@pytest.mark.parametrize("shape", SHAPES)
def test_it_is_the_published_iteration(shape: tuple[int, int], device: torch.device) -> None:
    """A rounding error grows as a small singular value does: at most by 3.4445 in a step."""
    G = torch.randn(3, *shape, dtype=torch.float64)
    truth = newton_schulz(G)
    eps = torch.finfo(torch.float64).eps
    assert (orthogonalize(G, device) - truth).norm() <= 3.4445**5 * eps * truth.norm()


@pytest.mark.parametrize("precision", ["fp32", "fast"])
@pytest.mark.parametrize("kind", ["columns", "parameters"])
def test_matrices_of_a_batch_do_not_touch_each_other(
    kind: str, precision: str, device: torch.device
) -> None:
    if kind == "columns":
        G = torch.randn(2, 3, 40, 50).to(device)[..., :33]
    else:  # of two members, each matrix followed by other parameters: aligned to 4 bytes only
        params = torch.randn(2, 5003).to(device)
        G = params.as_strided((2, 3, 40, 33), (5003, 1321, 33, 1), 1)
    together = orthogonalize(G, device, precision)
    for e in range(2):
        for k in range(3):
            assert torch.equal(together[e, k], orthogonalize(G[e, k], device, precision))
