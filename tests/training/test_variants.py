"""Training sets of variants of one flow: the same points, weights 0 where a variant has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from granpinn.data import Flow
from granpinn.data.outline import surface_of
from granpinn.data.scaling import scales_of
from granpinn.training.points import TrainingSet, training_set, training_sets
from tests.data.walled import line, single
from tests.flows import make_chute, make_flow


def fuller(flow: Flow, cells: int) -> Flow:
    """The flow with the first of its partly filled cells full, moving like the others."""
    partial = np.flatnonzero((flow.c.ravel() > 0) & (flow.c.ravel() < 1))[:cells]
    c, u, v = flow.c.copy(), flow.u.copy(), flow.v.copy()
    for field, value in ((c, 1.0), (u, 0.1), (v, -0.2)):
        field.reshape(-1)[partial] = value
    return replace(flow, c=c, u=u, v=v)


def sets_of(*flows: Flow, share: float = 1.0) -> list[TrainingSet]:
    variants = [(flow, surface_of(flow, "V1")) for flow in flows]
    return training_sets(variants, flows[0], scales_of(flows[0]), "V1", torch.float64, share)


def walled() -> Flow:
    """A chute that stands on its bed, under a plate with a known pressure over its left half."""
    walls = line((0, 0), (32, 0), (np.nan, np.nan), (0, 12), (16, 12))
    p = single(np.nan, np.nan, np.nan, 0.5, 0.7)
    return make_chute(walls=replace(walls, slip=single(0, 0, np.nan, 1, 1), p=p))


def test_walls_have_their_conditions_in_every_variant() -> None:
    """Fewer vectors count in the lower one; its walls weigh like one of its vectors."""
    full = walled()
    less = replace(full, c=np.where(full.c.cumsum(1) > 8, np.float32(0.7), full.c))
    (own,) = sets_of(full)
    line = full, surface_of(full, "V1")
    settings = full, scales_of(full), "V1", torch.float64, 1.0
    (again,) = training_sets([line], *settings, own)
    for name, values in own.arrays().items():
        assert torch.equal(getattr(again, name), values), name
    for found, N in zip(sets_of(full, less), (full.valid.sum(), less.valid.sum()), strict=True):
        assert torch.equal(found.wall_points, own.wall_points)
        assert torch.equal(found.wall_velocity, own.wall_velocity)
        pressed = own.surface_pressure > 0
        assert 0 < pressed.sum() < len(pressed)
        assert torch.equal(found.surface_pressure, own.surface_pressure)
        assert torch.equal(found.surface_points[pressed], own.surface_points[pressed])
        weights, W = found.pooled().point_weights, len(own.wall_points)
        torch.testing.assert_close(weights[-W:, 0], weights[:, 0].max().expand(W))
        expected = torch.tensor([(N + W) / N, 1.0]).double()
        torch.testing.assert_close(weights.mean(0), expected)


def test_a_variant_has_the_points_of_its_own() -> None:
    """Weighted means over the common points are means over the own points of each variant."""
    full = fuller(make_flow(), 300)
    less = replace(full, c=make_flow().c)
    lower, upper = (found.pooled() for found in sets_of(less, full))
    scales = scales_of(less)
    fixed = len(training_set(full, scales, "V0", torch.float64, 1.0).pooled().points)
    assert fixed < len(lower.points) == len(upper.points)  # the strip moves
    assert torch.equal(lower.points[:fixed], upper.points[:fixed])
    for variant, found in ((less, lower), (full, upper)):
        own = training_set(variant, scales, "V1", torch.float64)
        of_velocity = found.point_weights[:, 0] > 0
        assert torch.equal(found.points[of_velocity], own.points)
        assert torch.equal(found.velocity[of_velocity], own.velocity)
        mean = (found.point_weights[:, :1] * found.velocity).mean(0)
        torch.testing.assert_close(mean, own.velocity.mean(0))
        torch.testing.assert_close(found.point_weights.mean(0), torch.ones(2).double())
    assert (lower.point_weights[:, 0] > 0).sum() < (upper.point_weights[:, 0] > 0).sum()
    assert (lower.point_weights[:, 1] > 0).sum() < (upper.point_weights[:, 1] > 0).sum()


def test_surfaces_are_those_of_the_variants() -> None:
    flow = make_flow()
    line = surface_of(flow, "V1")
    higher = replace(line, y=line.y + 0.01)
    scales = scales_of(flow)
    variants = [(flow, line), (flow, higher)]
    found = training_sets(variants, flow, scales, "V1", torch.float64, 1.0)
    lower, upper = (variant.pooled() for variant in found)
    shift = (upper.surface_points - lower.surface_points).mean(0).tolist()
    np.testing.assert_allclose(shift, [0, 0.01 / scales.length, 0], atol=1e-6)
    assert torch.equal(upper.surface_pressure, torch.zeros(len(line.t)).double())
    strip = (upper.points - lower.points).norm(dim=1) > 0
    assert strip.any()
    moved = (upper.points - lower.points)[strip, 1]
    assert ((moved > 0) & (moved < 0.011 / scales.length)).all()
    # The strip is thicker, so its points stand for more.
    ratio = upper.point_weights[strip, 1] / lower.point_weights[strip, 1]
    assert ratio.min() > 1
    assert upper.point_weights[strip, 0].abs().max() == 0
