"""Training sets: of one flow, or of variants of it whose points correspond.

Variants differ in which cells count as full of grains, and in the free surface. All points of all
variants are in every set, in one order; a point that a variant lacks has the weight 0 there. So the
same draw of points serves all, and its scatter cancels in a difference. A flow alone is the only
variant of itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from granpinn.data.collocation import (
    above_ground_after_start,
    lie_between,
    points_between,
    with_collocation,
)
from granpinn.data.flow import Flow, Surface
from granpinn.data.points import TrainingSet, place_of, training_set
from granpinn.data.source import source_at
from granpinn.data.surface_strip import draw, strip_of, with_even_weights
from granpinn.data.wall_points import with_walls
from granpinn.physics.scales import Scales


def training_sets(
    variants: Sequence[tuple[Flow, Surface]],
    flow: Flow,
    scales: Scales,
    level: str,
    collocation: float,
    dtype: torch.dtype,
) -> list[TrainingSet]:
    """The points of a fit for every variant: data, free surface, points of the equations between
    the vectors and in the strip under the surface, and points of walls.

    Points in the strip move with the surface, and so differ between the sets. Walls have the same
    conditions in all sets. The mean of a loss over a set is that over the own points of a variant.

    Args:
        variants: flows that differ in `c` alone, each with its points of the free surface; all
            surfaces have the same number of points.
        flow: the vectors that decide about the conditions on its walls.
        collocation: points between the vectors for each vector.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    union, first = variants[0]
    if len(variants) > 1:
        union = replace(union, c=np.max([variant.c for variant, _ in variants], axis=0))
    data = training_set(union, scales, level, dtype, first)
    data = with_collocation(data, union, scales, collocation)
    sets = [_variant(data, union, *variant, scales) for variant in variants]
    if level != "V0" and len(data.between) > 0:
        sets = _with_strips(sets, union, scales)
    on_walls = with_walls(data, flow, scales)
    count = len(data.surface_points)
    complete = [_with_walls_of(on_walls, with_even_weights(made), count) for made in sets]
    return [_with_source(made, flow, scales) for made in complete]


def _variant(
    data: TrainingSet, union: Flow, flow: Flow, surface: Surface, scales: Scales
) -> TrainingSet:
    """The training set of all variants with the weights and the surface of one."""
    line = torch.as_tensor(place_of(surface, flow, scales)).to(data.surface_points)
    made = replace(data, surface_points=line)
    if flow.particles is not None or np.array_equal(flow.material, union.material):
        return made
    kept = union.valid & union.after_start(union.t)[:, None, None]
    own = torch.as_tensor(flow.material[kept]).to(data.point_weights)
    velocity, physics = (data.point_weights * own[:, None]).unbind(1)
    velocity = velocity / velocity.mean()
    x, y, t = points_between(union, above_ground_after_start(union), len(data.between))
    inside = lie_between(flow, above_ground_after_start(flow), x, y, t)
    return replace(
        made,
        point_weights=torch.stack([velocity, physics], 1),
        equation_weights=torch.as_tensor(inside).to(data.equation_weights),
    )


def _with_strips(sets: Sequence[TrainingSet], flow: Flow, scales: Scales) -> list[TrainingSet]:
    """The sets with the same points in their strips under the surface, which stand for its area."""
    own = [made.point_weights[:, 0] > 0 for made in sets]
    below = [replace(s, points=s.points[k]) for s, k in zip(sets, own, strict=True)]
    strips = [strip_of(s, flow, scales) for s in below]
    drawn = draw(strips, len(sets[0].between), len(sets[0].points))
    if drawn is None:
        return list(sets)
    mean = np.mean([strip.area for strip in strips], axis=0).clip(1e-12)
    made = []
    for own_set, strip in zip(sets, strips, strict=True):
        share = drawn.weight * (strip.area / mean)[drawn.place]
        of_strip = torch.as_tensor(share).to(own_set.equation_weights)
        weights = torch.cat([own_set.equation_weights, of_strip])
        made.append(replace(own_set, strip=strip.points(drawn), equation_weights=weights))
    return made


def _with_source(made: TrainingSet, flow: Flow, scales: Scales) -> TrainingSet:
    """The set with the source term of the flow at its points of the equations."""
    points = torch.cat([made.points, made.between, made.strip])
    return replace(made, source=source_at(points, flow, scales))


def _with_walls_of(on_walls: TrainingSet, made: TrainingSet, count: int) -> TrainingSet:
    """A set with the walls of another one, whose first `count` surface points are no walls."""
    line = torch.cat([made.surface_points, on_walls.surface_points[count:]])
    return replace(
        made,
        surface_points=line,
        surface_pressure=on_walls.surface_pressure,
        wall_points=on_walls.wall_points,
        wall_velocity=on_walls.wall_velocity,
    )
