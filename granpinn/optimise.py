"""One optimization step on flat vectors: Adam, or Muon on the hidden matrices with Adam elsewhere.

The state lives in a few flat tensors (`tensors`), which is all that a checkpoint needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor
from torch.optim.adam import adam

from granpinn.config import Optimizer
from granpinn.network import views

BETA_1 = 0.9


class FlatOptimizer:
    """Updates the network's params [P] and the rheology scalars [2] in place."""

    def __init__(
        self, params: Tensor, scalars: Tensor, widths: Sequence[int], settings: Optimizer
    ) -> None:
        self.settings = settings
        hidden = range(1, len(widths) - 2) if settings.method == "muon" else range(0)
        self._matrices = [views(params, widths)[layer][0] for layer in hidden]
        self._slices = _runs_outside(params, self._matrices)
        self._network = _Adam([params[s] for s in self._slices], settings)
        self._scalars = _Adam([scalars], settings)
        self._momenta = [torch.zeros_like(W) for W in self._matrices]
        self._matrix_slices = [_slice_of(W) for W in self._matrices]

    def step(self, grad_params: Tensor, grad_scalars: Tensor | None, factor: float) -> None:
        """One update at `factor` times the learning rates of the settings.

        Args:
            grad_params: d loss / d params [P].
            grad_scalars: d loss / d q [2], None while the scalars are not trained.
        """
        s = self.settings
        self._network.step([grad_params[i] for i in self._slices], factor * s.learning_rate)
        if grad_scalars is not None:
            self._scalars.step([grad_scalars], factor * s.scalars_learning_rate)
        for W, B, i in zip(self._matrices, self._momenta, self._matrix_slices, strict=True):
            muon(W, grad_params[i].view_as(W), B, factor * s.muon_learning_rate, s.momentum)

    def reset(self) -> None:
        """Forget all momenta: the loss is another one from here on."""
        for tensor in self.tensors().values():
            tensor.zero_()

    def tensors(self) -> dict[str, Tensor]:
        """Every tensor of the state by name, live: copying into them restores it."""
        found = self._network.tensors("network") | self._scalars.tensors("scalars")
        return found | {f"muon.momentum.{i}": B for i, B in enumerate(self._momenta)}


class _Adam:
    """Adam (Kingma & Ba, 2015) through torch's fused kernel."""

    def __init__(self, params: list[Tensor], settings: Optimizer) -> None:
        self.params = params
        self.settings = settings
        self.first = [torch.zeros_like(p) for p in params]
        self.second = [torch.zeros_like(p) for p in params]
        self.steps = [torch.zeros((), dtype=torch.float32, device=p.device) for p in params]

    def step(self, grads: list[Tensor], learning_rate: float) -> None:
        adam(
            self.params,
            grads,
            self.first,
            self.second,
            [],
            self.steps,
            fused=True,
            amsgrad=False,
            beta1=BETA_1,
            beta2=self.settings.beta_2,
            lr=learning_rate,
            weight_decay=0.0,
            eps=self.settings.epsilon,
            maximize=False,
        )

    def tensors(self, name: str) -> dict[str, Tensor]:
        kinds = {"first": self.first, "second": self.second, "steps": self.steps}
        return {
            f"adam.{name}.{kind}.{i}": t for kind, ts in kinds.items() for i, t in enumerate(ts)
        }


def _runs_outside(params: Tensor, matrices: list[Tensor]) -> list[slice]:
    """The contiguous runs of params [P] that belong to no matrix."""
    runs, start = [], 0
    for i in map(_slice_of, matrices):
        runs.append(slice(start, i.start))
        start = i.stop
    return [*runs, slice(start, params.numel())]


def _slice_of(W: Tensor) -> slice:
    """Where a matrix lies in the vector that it is a view of."""
    start = int(W.storage_offset())
    return slice(start, start + W.numel())


def muon(W: Tensor, G: Tensor, B: Tensor, learning_rate: float, momentum: float) -> None:
    """One Muon update of W [m, n] from its gradient G and its momentum B, both [m, n].

    Jordan et al., "Muon: an optimizer for hidden layers in neural networks" (2024): the
    Nesterov-averaged gradient with its singular values set to about 1.
    """
    B.lerp_(G, 1 - momentum)
    scale = math.sqrt(max(1.0, W.shape[0] / W.shape[1]))  # 1 for square matrices
    W.sub_(orthogonalized(G.lerp(B, momentum)), alpha=learning_rate * scale)


def orthogonalized(G: Tensor, steps: int = 5) -> Tensor:
    """U V^T of G = U S V^T to about 30 %, by `steps` Newton-Schulz iterations (quintic).

    In the precision of G: torch.optim.Muon has bfloat16 here, which is slow on processors without
    it and rounds the update to three digits.
    """
    a, b, c = 3.4445, -4.7750, 2.0315
    X: Tensor = G / torch.linalg.vector_norm(G).clamp(min=1e-30)
    if tall := G.shape[0] > G.shape[1]:
        X = X.T
    for _ in range(steps):
        A = X @ X.T
        X = torch.addmm(X, torch.addmm(A, A, A, beta=b, alpha=c), X, beta=a)
    return X.T if tall else X


def average_into(average: Tensor, value: Tensor, count: int) -> None:
    """Make `average`, the mean of count - 1 values, the mean of count values."""
    average.lerp_(value, 1 / count)
