"""Variants of one flow as training sets whose points correspond, for differences between them.

The variants differ in which cells count as full of grains, and in the free surface. All points of
all variants are in every set, in one order; a point that a variant lacks has the weight 0 there. So
the same draw of points serves all, and its scatter cancels in a difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from granpinn.arrays import Bool
from granpinn.data.collocation import (
    above_ground_after_start,
    count_between,
    lie_between,
    points_between,
    with_collocation,
)
from granpinn.data.flow import Flow, Surface
from granpinn.data.points import TrainingSet, training_set, turned_and_rounded
from granpinn.data.symmetry import axes_of
from granpinn.physics.scales import Scales


def corresponding_sets(
    variants: Sequence[tuple[Flow, Surface]],
    scales: Scales,
    level: str,
    collocation: float,
    dtype: torch.dtype,
) -> list[TrainingSet]:
    """The pooled training set (`TrainingSet.pooled`) of every variant.

    Args:
        variants: flows that differ in `c` alone, each with its points of the free surface; all
            surfaces have the same number of points.
        collocation: points between the vectors for each vector.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    flow = variants[0][0]
    union = replace(flow, c=np.max([variant.c for variant, _ in variants], axis=0))
    data = training_set(union, scales, level, dtype)
    everything = with_collocation(data, union, scales, collocation).pooled()
    sets = []
    for variant, surface in variants:
        belongs = _belongs(variant, union, count_between(collocation, len(data.points)))
        weights = _weights(everything, belongs)
        line = _surface_points(surface, union, scales, dtype)
        sets.append(replace(everything, point_weights=weights, surface_points=line))
    return sets


def _belongs(variant: Flow, union: Flow, between: int) -> Bool | None:
    """Which of the data points and the points between them the variant has [N + B]; None: all."""
    if variant.particles is not None or np.array_equal(variant.material, union.material):
        return None
    kept = union.valid & union.after_start(union.t)[:, None, None]
    x, y, t = points_between(union, above_ground_after_start(union), between)
    inside = lie_between(variant, above_ground_after_start(variant), x, y, t)
    return np.concatenate([variant.material[kept], inside])


def _weights(everything: TrainingSet, belongs: Bool | None) -> torch.Tensor:
    """Weights [N + B, 2] of the points that belong; their means are 1 again."""
    weights = everything.point_weights
    if belongs is None:
        return weights
    kept = weights * torch.as_tensor(belongs).to(weights)[:, None]
    return kept * (weights.mean(0) / kept.mean(0))


def _surface_points(
    surface: Surface, flow: Flow, scales: Scales, dtype: torch.dtype
) -> torch.Tensor:
    points = scales.points_to_dimensionless(surface.x, surface.y, surface.t)
    return torch.as_tensor(turned_and_rounded(points, axes_of(flow))).to(dtype)
