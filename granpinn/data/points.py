"""The points of training and scoring, dimensionless and in the order (t, y, x).

A training set is made slab by slab (`large.py`), and a flow that is not large is one slab. At most
`MOST_VECTORS` vectors train: a random part of every slab, the same in each, and the same for every
seed. There are as many points between the vectors, in the strip under the surface and on walls for
each vector that trains as in a flow whose vectors all train. Points in the strip and on walls come
from every n-th frame, points of the free surface from all frames. So a training set takes at most
`MOST_BYTES`. It holds more points than the default training draws, 2.6e7.

Variants of a flow differ in the cells that count as full of grains, and in the free surface. The
sets of all variants have the same points in one order; a point that a variant lacks has the weight
0 there. So one draw of points serves all, and its scatter cancels in a difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from granpinn.arrays import Bool, Float64, Index
from granpinn.config import LEVELS
from granpinn.data.collocation import above_ground, lie_between, lowest_row, points_between
from granpinn.data.flow import Flow, FlowFileError, Particles, Surface
from granpinn.data.large import of_frames, slabs, some_frames
from granpinn.data.noise import velocity_weights
from granpinn.data.outline import surface_of
from granpinn.data.partial_cells import filled_slabs
from granpinn.data.scaling import placed, turned_and_rounded
from granpinn.data.surface_strip import Strip, draw, strip_of
from granpinn.data.symmetry import axes_of
from granpinn.data.wall_points import walls_of, warn_of_contradictions
from granpinn.physics.axes import Axes
from granpinn.physics.terms import LossPoints

if TYPE_CHECKING:
    from granpinn.physics.scales import Scales

MOST_VECTORS = 2**24
# With as many points between the vectors: 28 bytes for a vector, 16 for a point between, and 28 for
# each once they are pooled.
MOST_BYTES = 100 * MOST_VECTORS
_KEY = 5 << 64  # of Philox; the same vectors for every seed


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
        strip: such points above the highest vectors, [S, 3] (granpinn/data/surface_strip.py).
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
        flow: with its partly filled cells (`with_partial_cells`) unless it is large.
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
) -> list[TrainingSet]:
    """The points of a fit for every variant of a flow.

    Points in the strip move with the surface, and so differ between the sets. Walls have the same
    conditions in all sets. The mean of a loss over a set is that over the own points of a variant.

    Args:
        variants: flows that differ in `c` alone, each with its points of the free surface; all
            surfaces have the same number of points.
        flow: the vectors that decide about the conditions on its walls.
        level, dtype, collocation: as in `training_set`.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    union = variants[0][0]
    if len(variants) > 1:
        union = replace(union, c=np.max([variant.c for variant, _ in variants], axis=0))
    _require_distinct(union, scales, dtype)
    made = _Made(variants, union, scales, level, dtype, collocation)
    for frames, own in filled_slabs(union, ahead=1):
        made.add(frames, own)
    sets = _with_walls(made.joined(), flow, scales, made.part)
    if flow.source is None:
        return sets
    return [
        replace(s, source=source_at(torch.cat([s.points, s.between, s.strip]), flow, scales))
        for s in sets
    ]


def vector_counts(flow: Flow) -> tuple[int, int]:
    """Vectors after the start in cells full of grains, and in cells with any grains."""
    if flow.particles is not None:
        return flow.particles.u.size, flow.particles.u.size
    full, some = 0, 0
    for k in slabs(flow):
        there = np.isfinite(flow.u[k]) & flow.after_start(flow.t[k])[:, None, None]
        full += int((there & (flow.c[k] >= 1)).sum())
        some += int((there & (flow.c[k] > 0)).sum())
    return full, some


def _frames(flow: Flow, part: float) -> Index:
    """The frames from which points in strips and on walls come, for a part of the vectors."""
    every = int(1 / part)
    return (
        np.arange(flow.t.size) if every == 1 else np.flatnonzero(flow.after_start(flow.t))[::every]
    )


class _Rows:
    """Rows in one block of memory: many small blocks would leave gaps between them.

    Args:
        most: rows; those that are never used take no memory.
    """

    def __init__(self, most: int, columns: int, dtype: torch.dtype) -> None:
        self._block, self._count = torch.empty(most, columns, dtype=dtype), 0

    def add(self, rows: Float64) -> torch.Tensor:
        """Add rows, and return them in the type of the block."""
        start, self._count = self._count, self._count + len(rows)
        added = self._block[start : self._count]
        added[:] = torch.as_tensor(rows)
        return added

    @property
    def all(self) -> torch.Tensor:
        """The rows so far [count, columns]."""
        return self._block[: self._count]


@dataclass
class _Made:
    """The points that were made of the slabs of a flow so far, for all variants.

    Args:
        flow: of all variants, with the cells that are full in any of them.
    """

    variants: Sequence[tuple[Flow, Surface]]
    flow: Flow
    scales: Scales
    level: str
    dtype: torch.dtype
    collocation: float

    def __post_init__(self) -> None:
        flow, dtype, count = self.flow, self.dtype, len(slabs(self.flow))
        full, some = vector_counts(flow)
        self.part = min(1.0, MOST_VECTORS / max(1, full))  # of the vectors that train
        self.frames = _frames(flow, self.part)
        self.collocation = 0.0 if flow.particles is not None else self.collocation
        self.row = lowest_row(flow) if self.collocation else None
        most = math.ceil(self.part * some) + count
        self.points, self.velocity = _Rows(most, 3, dtype), _Rows(most, 2, dtype)
        self.between = _Rows(round(self.collocation * most) + count, 3, dtype)
        self.variances: list[Float64] = []
        # For each variant: the vectors and the points between that it has, and its strips.
        self.own: list[list[Bool]] = [[] for _ in self.variants]
        self.inside: list[list[Bool]] = [[] for _ in self.variants]
        self.strips: list[list[Strip]] = [[] for _ in self.variants]

    def add(self, frames: slice, own: Flow) -> None:
        """Add a slab of frames, which is followed by one frame more up to which cells reach."""
        found = _samples(own, frames, self.part)
        if found is None:
            return
        samples, cells = found
        points = self._add_vectors(samples)
        count = round(self.collocation * len(points))
        place = None
        if count:
            place = points_between(own, above_ground(own, self.row), count, frames.start)
            self.between.add(placed(*place, self.flow, self.scales))
        for k, (variant, _) in enumerate(self.variants):
            if len(self.variants) > 1 and cells is not None:
                same = some_frames(variant, slice(frames.start, frames.stop + 1))
                self.own[k].append(same.c[cells] >= 1)
                if place is not None:
                    self.inside[k].append(lie_between(same, above_ground(same), *place))
        chosen = self.frames[(self.frames >= frames.start) & (self.frames < frames.stop)]
        if place is not None and self.level != "V0" and chosen.size:
            self._add_strips(chosen, points, some_frames(own, chosen - frames.start))

    def _add_vectors(self, samples: Particles) -> torch.Tensor:
        flow, scales = self.flow, self.scales
        measured = np.stack([samples.u, samples.v], -1, dtype=np.float64)
        velocity = scales.to_dimensionless(measured, "velocity")
        self.velocity.add(turned_and_rounded(velocity, axes_of(flow)))
        if samples.sigma_u is not None and samples.sigma_v is not None:
            sigmas = samples.sigma_u, samples.sigma_v
            variance = sum(np.square(s, dtype=np.float64) for s in sigmas)
            self.variances.append(np.asarray(variance))
        return self.points.add(placed(samples.x, samples.y, samples.t, flow, scales))

    def _add_strips(self, chosen: Index, points: torch.Tensor, own: Flow) -> None:
        """Add the strips at some frames, from all of their vectors."""
        masks = [parts[-1] if parts else None for parts in self.own]
        if self.part < 1:
            found = _samples(own, slice(0, own.t.size), 1.0)
            if found is None:
                return
            samples, cells = found
            points = self._tensor(placed(samples.x, samples.y, samples.t, self.flow, self.scales))
            if len(self.variants) > 1:
                masks = [some_frames(v, chosen).c[cells] >= 1 for v, _ in self.variants]
        for (_, surface), mask, strips in zip(self.variants, masks, self.strips, strict=True):
            line = self._tensor(self._line(of_frames(surface, self.flow.t, chosen)))
            near = points if mask is None else points[torch.as_tensor(mask)]
            places = near.double().numpy(), line.double().numpy()
            strips.append(strip_of(*places, self.flow, self.scales))

    def joined(self) -> list[TrainingSet]:
        """The set of every variant.

        Raises:
            FlowFileError: there are no vectors, or a number is too large.
        """
        points, velocity, between = self.points.all, self.velocity.all, self.between.all
        if len(points) == 0:
            raise FlowFileError(
                "c, u and v must hold valid vectors where c = 1 at t > 0, got none: start the "
                "clock at the release of the grains"
                if self.flow.particles is None
                else "particles/t must hold times after 0, got none: start the clock at the "
                "release of the grains"
            )
        weights = torch.ones(len(points), 2, dtype=self.dtype)
        if self.variances:
            weights[:, 0] = torch.as_tensor(velocity_weights(np.concatenate(self.variances)))
        sets = []
        for k, (_, surface) in enumerate(self.variants):
            made = TrainingSet(
                points,
                velocity,
                weights,
                self._tensor(self._line(surface)),
                self._tensor(_pressure_on(surface, self.scales, self.level)),
                lower=points.amin(0),
                upper=points.amax(0),
                between=between,
                strip=between[:0],
                equation_weights=torch.ones_like(between[:, 0]),
                wall_points=points[:0],
                wall_velocity=velocity[:0],
            )
            if self.own[k] and not (own := np.concatenate(self.own[k])).all():
                of_velocity, physics = (weights * torch.as_tensor(own)[:, None]).unbind(1)
                both = torch.stack([of_velocity / of_velocity.mean(), physics], 1)
                made = replace(made, point_weights=both)
            if self.inside[k]:
                inside = torch.as_tensor(np.concatenate(self.inside[k])).to(self.dtype)
                made = replace(made, equation_weights=inside)
            sets.append(made)
        for name, values in sets[0].arrays().items():
            if not torch.isfinite(values).all():
                raise FlowFileError(
                    f"{name.replace('_', ' ')} must be finite as {self.dtype} in dimensionless "
                    "units, got an overflow: check the units and the values of the flow"
                )
        return [_with_even_weights(made) for made in self._with_strips(sets)]

    def _with_strips(self, sets: list[TrainingSet]) -> list[TrainingSet]:
        """The sets with the same points in their strips under the surface, which stand for its
        area; those of the frames that were left out count too."""
        if not self.strips[0]:
            return sets
        share = self.part * int(1 / self.part)
        strips = [Strip(*map(np.concatenate, zip(*parts, strict=True))) for parts in self.strips]
        areas = [share * strip.area for strip in strips]
        drawn = draw(np.mean(areas, axis=0), len(sets[0].between), len(sets[0].points))
        if drawn is None:
            return sets
        mean, (place, part, weight) = np.mean(areas, axis=0).clip(1e-12), drawn
        made = []
        for own, strip, area in zip(sets, strips, areas, strict=True):
            of_strip = self._tensor(weight * (area / mean)[place])
            weights = torch.cat([own.equation_weights, of_strip])
            points = self._tensor(strip.points(place, part))
            made.append(replace(own, strip=points, equation_weights=weights))
        return made

    def _line(self, surface: Surface) -> Float64:
        return placed(surface.x, surface.y, surface.t, self.flow, self.scales)

    def _tensor(self, values: Float64) -> torch.Tensor:
        return torch.as_tensor(values).to(self.dtype)


def _samples(
    flow: Flow, frames: slice, part: float
) -> tuple[Particles, tuple[Index, ...] | None] | None:
    """A random part of the vectors after the start of a slab, in the units of the file and the
    order (t, y, x), and on a grid their cells; None if there are none.

    A uniform standard deviation does not change the weights and is left out.
    """
    particles = flow.particles
    if particles is not None:
        kept = flow.after_start(particles.t)
        some = {name: None if a is None else a[kept] for name, a in vars(particles).items()}
        return (Particles(**some), None) if kept.any() else None  # type: ignore[arg-type]
    k = slice(0, frames.stop - frames.start)
    kept = flow.valid_in(k) & flow.after_start(flow.t[k])[:, None, None]
    there = np.flatnonzero(kept)
    if there.size == 0:
        return None
    wanted = min(there.size, math.ceil(part * there.size))
    if wanted < there.size:
        rng = np.random.Generator(np.random.Philox(key=_KEY + frames.start))
        there = np.sort(rng.choice(there, wanted, replace=False, shuffle=False))
    frame, row, column = cells = np.unravel_index(there, kept.shape)
    varies = isinstance(flow.sigma_u, np.ndarray) or isinstance(flow.sigma_v, np.ndarray)
    names = ("u", "v", "sigma_u", "sigma_v") if varies else ("u", "v")
    fields = {n: np.broadcast_to(getattr(flow, n), flow.c.shape)[cells] for n in names}
    return Particles(t=flow.t[frame], y=flow.y[row], x=flow.x[column], **fields), cells


def _with_even_weights(made: TrainingSet) -> TrainingSet:
    """The set with weights of the equations whose mean over all their points is 1."""
    velocity, physics = made.point_weights.unbind(1)
    mean = float(torch.cat([physics, made.equation_weights]).double().mean())
    return replace(
        made,
        point_weights=torch.stack([velocity, physics / mean], 1),
        equation_weights=made.equation_weights / mean,
    )


def _with_walls(
    sets: list[TrainingSet], flow: Flow, scales: Scales, part: float
) -> list[TrainingSet]:
    """The sets with the velocities, and the known pressures, on the walls of a flow.

    Warns of conditions that the vectors contradict.
    """
    every = int(1 / part)
    found = walls_of(flow, (own for _, own in filled_slabs(flow, _frames(flow, part))))
    if found is None:
        return sets
    touch, facts = found
    warn_of_contradictions(facts)
    x, y, t = touch.point.T
    points = placed(x, y, t, flow, scales)
    velocity = turned_and_rounded(scales.to_dimensionless(touch.target, "velocity"), axes_of(flow))
    pressure = scales.to_dimensionless(touch.p, "pressure")
    used, known = np.isfinite(velocity).all(axis=1), np.isfinite(pressure)
    rng = np.random.Generator(np.random.Philox(key=_KEY - 1))

    def some(share: float, *rows: Any) -> Any:
        if share == 1:
            return rows
        n = len(rows[0])
        kept = rng.choice(n, round(share * n), replace=False, shuffle=False)
        return [a[kept] for a in rows]

    on_line: Index = np.arange(len(sets[0].surface_points))
    if known.any():  # as many points of the line for each of them as in all frames
        (on_line,) = some(1 / every, on_line)
    points_used, velocity = some(part * every, points[used], velocity[used])
    walled = []
    for made in sets:
        like, line = made.points, torch.as_tensor(on_line)
        pressed = [torch.as_tensor(a[known]).to(like) for a in (points, pressure)]
        walled.append(
            replace(
                made,
                wall_points=torch.as_tensor(points_used).to(like),
                wall_velocity=torch.as_tensor(velocity).to(like),
                surface_points=torch.cat([made.surface_points[line], pressed[0]]),
                surface_pressure=torch.cat([made.surface_pressure[line], pressed[1]]),
            )
        )
    return walled


def source_at(points: torch.Tensor, flow: Flow, scales: Scales) -> torch.Tensor | None:
    """(S_x, S_y) [N, 2] of `Flow.source`, dimensionless, in the axes and with the type of the
    points; None: none.

    Args:
        points: (x, y, t) [N, 3] of the training.

    Raises:
        FlowFileError: the source is not finite, or has another shape than the points.
    """
    if flow.source is None:
        return None
    axes = axes_of(flow)
    x, y, t = points.double().cpu().numpy().T
    places = scales.points_to_physical(np.stack([*axes.undo(x, y), t], -1))
    force = np.stack(flow.source(*places.T), -1)
    if force.shape != (len(points), 2) or not np.isfinite(force).all():
        raise FlowFileError(
            f"the source of a flow must give finite numbers S_x [n], S_y [n] for x, y, t [n], got "
            f"{list(force.shape)} with {int((~np.isfinite(force)).sum())} not finite for "
            f"{len(points)} points: correct the function"
        )
    turned = np.stack(axes.turn(*scales.to_dimensionless(force, "acceleration").T), -1)
    return torch.as_tensor(turned).to(points)


def test_grid(flow: Flow, scales: Scales) -> tuple[torch.Tensor, tuple[Index, ...]]:
    """All points with c = 1, for scoring and for maps of the fields.

    Returns:
        (x, y, t) [K, 3] in float64, and their frame, row and column, three arrays [K].
    """
    frame, row, column = cells = np.nonzero(flow.material)
    points = scales.points_to_dimensionless(flow.x[column], flow.y[row], flow.t[frame])
    return torch.as_tensor(points), cells


def _require_distinct(flow: Flow, scales: Scales, dtype: torch.dtype) -> None:
    """Raises FlowFileError if two times, rows or columns are one number in the training."""
    level = Axes(1.0, 0.0, (0.0, -1.0))  # each coordinate for itself
    for k, (name, values) in enumerate((("x", flow.x), ("y", flow.y), ("t", flow.t))):
        place = list(scales.origin)
        place[k] = values  # type: ignore[call-overload]
        points = turned_and_rounded(scales.points_to_dimensionless(*place), level)
        found = np.unique(torch.as_tensor(points[:, k]).to(dtype).numpy()).size
        if found < values.size:
            raise FlowFileError(
                f"{name} must have steps that {str(dtype).removeprefix('torch.')} resolves, got "
                f"{values.size} values of which {found} differ after rounding: leave out values "
                "that are too close, or correct the unit of the coordinates"
            )


def _pressure_on(surface: Surface, scales: Scales, level: str) -> Float64:
    """The dimensionless pressure on a free surface [M]."""
    if level != "V2" or surface.p is None:
        return np.zeros(surface.t.size)
    return scales.to_dimensionless(surface.p.astype(np.float64), "pressure")
