"""The points of training, dimensionless and in the order (t, y, x).

Variants of a flow differ in the cells that count as full of grains, and in the free surface. The
sets of all variants have the same points in one order; a point that a variant lacks has the weight
0 there. So one draw of points serves all, and its scatter cancels in a difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from granpinn.arrays import Index
from granpinn.config import LEVELS
from granpinn.data.collocation import (
    drawn,
    lie_between,
    points_between,
    strip_of,
)
from granpinn.data.flow import Flow, FlowFileError, Particles, Surface
from granpinn.data.large import chosen
from granpinn.data.noise import velocity_weights
from granpinn.data.outline import surface_of
from granpinn.data.scaling import moving, placed, unplaced
from granpinn.data.symmetry import axes_of
from granpinn.data.wall_points import walls_of, warn_of_contradictions
from granpinn.physics.scales import Scales
from granpinn.physics.terms import LossPoints


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Points of a training: N of the data, M of the free surface, B and S of the equations alone,
    W of walls.

    Positions and velocities are in the axes of granpinn/physics/axes.py.

    Attributes:
        points: (x, y, t) of the data, [N, 3].
        velocity: measured (u, v), [N, 2].
        point_weights: weights of the velocity and of the physics at each point, [N, 2]; the mean
            is 1. A point with weights 0 belongs to another variant of the flow.
        surface_points: (x, y, t) of the free surface, [M, 3]; at level V0, points of the upper
            outline of the data.
        surface_pressure: [M]; 0 at levels V0 and V1, measured at V2.
        lower, upper: bounds of the points, [3].
        between: (x, y, t) of points with the residuals of the equations alone, [B, 3]
            (granpinn/data/collocation.py).
        strip: such points above the highest vectors, [S, 3] (granpinn/data/collocation.py).
        equation_weights: weights of the equations at the points between and of the strip, [B + S].
        wall_points, wall_velocity: (x, y, t) on walls and the velocity of the grains there, [W, 3]
            and [W, 2] (granpinn/data/wall_points.py). The equations do not count there: a shear
            layer on a wall may be thinner than the spacing of the vectors.
        source: force per mass beside gravity at the data points, the points between and those of
            the strip [N + B + S, 2]; None: none.
    """

    points: torch.Tensor
    velocity: torch.Tensor
    point_weights: torch.Tensor
    surface_points: torch.Tensor
    surface_pressure: torch.Tensor
    lower: torch.Tensor
    upper: torch.Tensor
    between: torch.Tensor
    strip: torch.Tensor
    equation_weights: torch.Tensor
    wall_points: torch.Tensor
    wall_velocity: torch.Tensor
    source: torch.Tensor | None = None

    def arrays(self) -> dict[str, torch.Tensor]:
        """All arrays by name; `source` only where there is one."""
        return {name: value for name, value in vars(self).items() if value is not None}

    @property
    def loss_points(self) -> LossPoints:
        """The part that the residual loss takes."""
        return LossPoints._make(getattr(self, name) for name in LossPoints._fields)

    def pooled(self) -> TrainingSet:
        """The training set with the B, S and W points among the data points, for batches.

        The velocity at the B and S points has the weight 0, and so have the equations at the W
        points. The others have more weight in return, so that the mean over all points is the sum
        over data and walls by N; the equations, by N + B + S. Vectors with the weight 0 do not
        count in N.
        """
        alone = torch.cat([self.between, self.strip])
        N, B, W = len(self.points), len(alone), len(self.wall_points)
        if B + W == 0:
            return self
        velocity, physics = self.point_weights.unbind(1)
        of_data, of_equations = (N + B + W) / N, (N + B + W) / (N + B)
        of_walls = (N + B + W) / int((velocity > 0).sum())
        unknown = self.velocity.new_zeros(B, 2)
        of_points = [
            torch.stack([velocity * of_data, physics * of_equations], 1),
            torch.stack([unknown[:, 0], self.equation_weights * of_equations], 1),
            physics.new_tensor([of_walls, 0.0]).expand(W, 2),
        ]
        source = self.source
        return replace(
            self,
            source=None if source is None else torch.cat([source, source.new_zeros(W, 2)]),
            points=torch.cat([self.points, alone, self.wall_points]),
            velocity=torch.cat([self.velocity, unknown, self.wall_velocity]),
            point_weights=torch.cat(of_points),
            between=self.between[:0],
            strip=self.strip[:0],
            equation_weights=self.equation_weights[:0],
            wall_points=self.wall_points[:0],
            wall_velocity=self.wall_velocity[:0],
        )


def training_set(
    flow: Flow,
    scales: Scales,
    level: str = "V1",
    dtype: torch.dtype = torch.float32,
    collocation: float = 0.0,
) -> TrainingSet:
    """The points of a fit: vectors, free surface, points of the equations alone, and walls.

    A vector counts if it is valid, at t > 0 or at any time of a steady flow, and on a grid where
    c = 1.

    Args:
        flow: with its partly filled cells (`with_partial_cells`).
        level: "V0": velocity only, p = 0 on the upper `outline` of its points; "V1": also the line
            of the free surface, with p = 0; "V2": also the measured pressure on this line.
        dtype: of all tensors.
        collocation: points between the vectors for each vector.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    if level not in LEVELS:
        raise ValueError(f"level must be one of {', '.join(LEVELS)}, got {level!r}")
    variant = flow, surface_of(flow, level)
    return training_sets([variant], flow, scales, level, dtype, collocation)[0]


def training_sets(
    variants: Sequence[tuple[Flow, Surface]],
    flow: Flow,
    scales: Scales,
    level: str,
    dtype: torch.dtype,
    collocation: float,
    walled: TrainingSet | None = None,
) -> list[TrainingSet]:
    """The points of a fit for every variant of a flow.

    Points in the strip move with the surface, and so differ between the sets. Walls have the same
    conditions in all sets. The mean of a loss over a set is that over the own points of a variant.

    Args:
        variants: flows that differ in `c` alone, each with its points of the free surface; all
            surfaces have the same number of points.
        flow: the vectors that decide about the conditions on its walls.
        level, dtype, collocation: as in `training_set`.
        walled: a set of `flow`, if there is one: it has the same points on walls.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    flows, lines = zip(*variants, strict=True)
    union = flows[0]
    if len(flows) > 1:  # with the cells that are full in any of them
        union = replace(union, c=np.max([variant.c for variant in flows], axis=0))
    common, own, inside = _common(union, flows, scales, collocation, dtype)
    sets = []
    for k, line in enumerate(lines):
        weights = common.point_weights
        if not own[:, k].all():
            of_velocity, physics = (weights * own[:, k, None]).unbind(1)
            weights = torch.stack([of_velocity / of_velocity.mean(), physics], 1)
        on_line = torch.as_tensor(placed(line.x, line.y, line.t, flow, scales)).to(dtype)
        pressure = np.zeros(line.t.size) if level != "V2" or line.p is None else line.p
        pressure = scales.to_dimensionless(pressure.astype(np.float64), "pressure")
        sets.append(
            replace(
                common,
                point_weights=weights,
                surface_points=on_line,
                surface_pressure=torch.as_tensor(pressure).to(dtype),
                equation_weights=inside[:, k].to(dtype),
            )
        )
    for name, values in sets[0].arrays().items():
        if not torch.isfinite(values).all():
            raise FlowFileError(
                f"{name.replace('_', ' ')} must be finite as {dtype} in dimensionless "
                "units, got an overflow: check the units and the values of the flow"
            )
    if level != "V0" and len(common.between):
        sets = _with_strips(sets, flow, scales)
    walls = _on_walls(flow, scales, sets[0], walled)
    return [_finished(made, walls, flow, scales) for made in sets]


def vector_count(flow: Flow) -> int:
    """Vectors after the start, also in partly filled cells."""
    if flow.particles is not None:
        return int(flow.particles.u.size)
    there = np.isfinite(flow.u) & flow.after_start(flow.t)[:, None, None]
    return int((there & (flow.c > 0)).sum())


def _common(
    union: Flow,
    variants: Sequence[Flow],
    scales: Scales,
    collocation: float,
    dtype: torch.dtype,
) -> tuple[TrainingSet, torch.Tensor, torch.Tensor]:
    """The points of all V variants, without a surface, and those that each variant has.

    Args:
        union: with the cells that are full in any of them.
        collocation: points between the vectors of a grid for each vector.

    Returns:
        The set, and which of its vectors [N, V] and of its points between [B, V] a variant has.
    """
    vectors, cells = _vectors(union)
    if len(vectors.t) == 0:
        raise FlowFileError(
            "there must be vectors at t > 0, on a grid where c = 1, got none: start the clock at "
            "the release of the grains"
        )
    own = np.ones((len(vectors.t), len(variants)), bool)
    between, inside = np.empty((0, 3)), np.empty((0, len(variants)), bool)
    if len(variants) > 1 and cells is not None:
        own = np.stack([variant.c[cells] >= 1 for variant in variants], 1)
    if cells is not None and (count := round(collocation * len(own))):
        places = points_between(union, count)
        between = placed(*places, union, scales)
        inside = np.ones((len(places[0]), len(variants)), bool)
        if len(variants) > 1:
            inside = np.stack([lie_between(v, *places) for v in variants], 1)
    points, velocity, alone = (
        torch.as_tensor(a).to(dtype)
        for a in (
            placed(vectors.x, vectors.y, vectors.t, union, scales),
            moving(vectors.u, vectors.v, union, scales),
            between,
        )
    )
    weights = torch.ones_like(velocity)
    if vectors.sigma_u is not None and vectors.sigma_v is not None:
        squares = [sigma.astype(np.float64) ** 2 for sigma in (vectors.sigma_u, vectors.sigma_v)]
        weights[:, 0] = torch.as_tensor(velocity_weights(squares[0] + squares[1]))
    common = TrainingSet(
        points,
        velocity,
        weights,
        surface_points=points[:0],
        surface_pressure=points[:0, 0],
        lower=points.amin(0),
        upper=points.amax(0),
        between=alone,
        strip=alone[:0],
        equation_weights=alone[:, 0],
        wall_points=points[:0],
        wall_velocity=velocity[:0],
    )
    return common, torch.as_tensor(own), torch.as_tensor(inside)


def _vectors(flow: Flow) -> tuple[Particles, tuple[Index, ...] | None]:
    """The vectors after the start, in the units of the file and the order (t, y, x), and on a grid
    their cells.

    A uniform standard deviation does not change the weights and is left out.
    """
    if flow.particles is not None:
        return chosen(flow.particles, flow.after_start(flow.particles.t)), None
    there = flow.valid & flow.after_start(flow.t)[:, None, None]
    frame, row, column = cells = np.nonzero(there)
    varies = isinstance(flow.sigma_u, np.ndarray) or isinstance(flow.sigma_v, np.ndarray)
    names = ("u", "v", "sigma_u", "sigma_v") if varies else ("u", "v")
    fields = {n: np.broadcast_to(getattr(flow, n), flow.c.shape)[cells] for n in names}
    return Particles(t=flow.t[frame], y=flow.y[row], x=flow.x[column], **fields), cells


def _with_strips(sets: list[TrainingSet], flow: Flow, scales: Scales) -> list[TrainingSet]:
    """The sets with the same points in their strips under the surface, which stand for its area."""
    strips = []
    for made in sets:
        own = made.points[made.point_weights[:, 0] > 0]
        places = own.double().numpy(), made.surface_points.double().numpy()
        strips.append(strip_of(*places, flow, scales))
    found = drawn(strips, len(sets[0].between), len(sets[0].points))
    return [
        replace(
            made,
            strip=torch.as_tensor(points).to(made.points),
            equation_weights=torch.cat(
                [made.equation_weights, torch.as_tensor(weights).to(made.points)]
            ),
        )
        for made, (points, weights) in zip(sets, found, strict=True)
    ]


def _finished(
    made: TrainingSet, walls: Sequence[torch.Tensor], flow: Flow, scales: Scales
) -> TrainingSet:
    """The set with walls and sources, and with weights of the equations whose mean over all their
    points is 1."""
    velocity, physics = made.point_weights.unbind(1)
    mean = float(torch.cat([physics, made.equation_weights]).double().mean())
    wall_points, wall_velocity, loaded, load = walls
    return replace(
        made,
        point_weights=torch.stack([velocity, physics / mean], 1),
        equation_weights=made.equation_weights / mean,
        wall_points=wall_points,
        wall_velocity=wall_velocity,
        surface_points=torch.cat([made.surface_points, loaded]),
        surface_pressure=torch.cat([made.surface_pressure, load]),
        source=source_at(torch.cat([made.points, made.between, made.strip]), flow, scales),
    )


def _on_walls(
    flow: Flow, scales: Scales, made: TrainingSet, walled: TrainingSet | None
) -> Sequence[torch.Tensor]:
    """Points on the walls of a flow and the velocities there, and those of known pressure with it.

    Warns of conditions that the vectors contradict.

    Args:
        made: a set without walls.
        walled: as in `training_sets`.
    """
    M = len(made.surface_points)
    if walled is not None or flow.walls is None:
        old = walled or made
        loaded, load = old.surface_points[M:], old.surface_pressure[M:]
        return old.wall_points, old.wall_velocity, loaded, load
    touch, facts = walls_of(flow, flow.walls)
    warn_of_contradictions(facts)
    (x, y, t), (u, v) = touch.point.T, touch.target.T
    points, velocity = placed(x, y, t, flow, scales), moving(u, v, flow, scales)
    pressure = scales.to_dimensionless(touch.p, "pressure")
    used, known = np.isfinite(velocity).all(axis=1), np.isfinite(pressure)
    arrays = points[used], velocity[used], points[known], pressure[known]
    return [torch.as_tensor(a).to(made.points) for a in arrays]


def source_at(points: torch.Tensor, flow: Flow, scales: Scales) -> torch.Tensor | None:
    """(S_x, S_y) [N, 2] of `Flow.source`, dimensionless, in the axes and with the type of the
    points; None: none.

    Args:
        points: (x, y, t) [N, 3] of the training.
    """
    if flow.source is None:
        return None
    places = unplaced(points.double().cpu().numpy(), flow, scales)
    force = np.stack(flow.source(*places.T), -1)
    turned = np.stack(axes_of(flow).turn(*scales.to_dimensionless(force, "acceleration").T), -1)
    return torch.as_tensor(turned).to(points)
