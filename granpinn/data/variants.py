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

from granpinn.arrays import Float64
from granpinn.data.collocation import (
    above_ground_after_start,
    lie_between,
    points_between,
    with_collocation,
)
from granpinn.data.flow import Flow, Surface
from granpinn.data.points import TrainingSet, training_set, turned_and_rounded
from granpinn.data.surface_strip import draw, strip_of
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

    Points in the strip under the surface move with it, and so differ between the sets.

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
    everything = with_collocation(data, union, scales, collocation)
    lines = [_surface_points(surface, union, scales, dtype) for _, surface in variants]
    full = [_belongs(variant, union, len(everything.between)) for variant, _ in variants]
    strips = []
    for belongs, line in zip(full, lines, strict=True):
        vectors = data.points[torch.as_tensor(belongs[: len(data.points)] > 0)]
        strips.append(strip_of(replace(data, points=vectors, surface_points=line), union, scales))
    drawn = None
    if level != "V0" and len(everything.between) > 0:
        drawn = draw(strips, len(everything.between), len(data.points))
    sets = []
    for belongs, line, strip in zip(full, lines, strips, strict=True):
        own = replace(everything, surface_points=line)
        if drawn is not None:
            share = strip.area / np.mean([other.area for other in strips], axis=0).clip(1e-12)
            belongs = np.concatenate([belongs, share[drawn.place]])
            own = replace(own, strip=strip.points(drawn))
        own = own.pooled()
        sets.append(replace(own, point_weights=_weights(own, belongs)))
    return sets


def _belongs(variant: Flow, union: Flow, between: int) -> Float64:
    """1 for the data points and the points between them that the variant has, else 0 [N + B]."""
    if union.particles is not None:
        return np.ones(int(union.after_start(union.particles.t).sum()))
    kept = union.valid & union.after_start(union.t)[:, None, None]
    if np.array_equal(variant.material, union.material):
        return np.ones(int(kept.sum()) + between)
    x, y, t = points_between(union, above_ground_after_start(union), between)
    inside = lie_between(variant, above_ground_after_start(variant), x, y, t)
    return np.concatenate([variant.material[kept], inside]).astype(np.float64)


def _weights(everything: TrainingSet, belongs: Float64) -> torch.Tensor:
    """Weights [N + B, 2] of the points that belong; their means are those of all points."""
    weights = everything.point_weights
    kept = weights * torch.as_tensor(belongs).to(weights)[:, None]
    return kept * (weights.mean(0) / kept.mean(0))


def _surface_points(
    surface: Surface, flow: Flow, scales: Scales, dtype: torch.dtype
) -> torch.Tensor:
    points = scales.points_to_dimensionless(surface.x, surface.y, surface.t)
    return torch.as_tensor(turned_and_rounded(points, axes_of(flow))).to(dtype)
