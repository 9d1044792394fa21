"""The loss at the end of a training, over many points."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Loss:
    """The loss at the end of a training, over many points (identification/final_loss.py).

    Attributes:
        n_points: points inside the grains.
        terms: half the mean square of every residual by `terms.NAMES`, dimensionless.
        weights: 1/sigma^2 of every term at the end of the training.
    """

    n_points: int
    terms: dict[str, float]
    weights: dict[str, float]

    def total(self, weights: dict[str, float] | None = None) -> float:
        """The sum of the weighted terms, by default with the weights of the training."""
        chosen = weights or self.weights
        return sum(chosen[name] * term for name, term in self.terms.items())
