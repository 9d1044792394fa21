"""The points of training and scoring, dimensionless and in the order (t, y, x)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from granpinn.arrays import Bool, Float64, Floats, Index
from granpinn.config import LEVELS
from granpinn.data.flow import Flow, FlowFileError, Particles, Surface
from granpinn.data.large import chosen
from granpinn.data.noise import variance, velocity_weights
from granpinn.data.outline import outline
from granpinn.data.symmetry import axes_of
from granpinn.physics.axes import Axes

if TYPE_CHECKING:
    from granpinn.physics.scales import Scales

# In the toe the layer is thinner than this many grains, and p = 0 does not hold. A flow with
# periodic sides has no toe.
TOE_GRAINS = 2.0
# Positions and velocities are rounded to this, the resolution of float32 at 1 and far below any
# measurement. The same data in other units differ by 1e-16. After rounding they are equal, and so
# are their trainings.
RESOLUTION = 2.0**-24

Indices = tuple[Index, Index, Index]


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Points of a training: N of the data, M of the free surface, B and S of the equations alone,
    W of walls.

    Positions and velocities are in the axes of granpinn/physics/axes.py.

    Attributes:
        points: (x, y, t) of the data, [N, 3].
        velocity: measured (u, v), [N, 2].
        point_weights: weights of the velocity and of the physics at each point, [N, 2]; the mean
            is 1. A point with weights 0 is of another variant of the flow
            (granpinn/data/variants.py).
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


@dataclass(frozen=True, eq=False)
class TestGrid:
    """All points with c = 1: `points` [K, 3] = (x, y, t), float64, and their indices.

    `indices` are three arrays [K] (frame, row, column): `flow.u[grid.indices]` is u there.
    """

    points: torch.Tensor
    indices: Indices


def training_set(
    flow: Flow,
    scales: Scales,
    level: str = "V1",
    dtype: torch.dtype = torch.float32,
    surface: Surface | None = None,
) -> TrainingSet:
    """The data points (valid vector; on a grid: c = 1) and the surface points of a level.

    They are at t > 0, or at any time of a steady flow.

    Args:
        level: "V0": velocity only, p = 0 on the upper `outline` of its points; "V1": also the line
            of the free surface, with p = 0; "V2": also the measured pressure on this line.
        dtype: of all tensors.
        surface: points of the free surface, by default those of the level.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    if level not in LEVELS:
        raise ValueError(f"level must be one of {', '.join(LEVELS)}, got {level!r}")
    _require_distinct(flow, scales, dtype)
    samples = samples_of(flow)
    axes = axes_of(flow)
    points = scales.points_to_dimensionless(samples.x, samples.y, samples.t)
    measured = np.stack([samples.u, samples.v], -1, dtype=np.float64)
    velocity = scales.to_dimensionless(measured, "velocity")
    weights = np.stack([_velocity_weights(samples), np.ones(len(points))], -1)
    surface = surface_of(flow, level) if surface is None else surface
    points, velocity = (turned_and_rounded(values, axes) for values in (points, velocity))

    def tensor(values: Floats) -> torch.Tensor:
        return torch.as_tensor(values).to(dtype)

    training = TrainingSet(
        tensor(points),
        tensor(velocity),
        tensor(weights),
        tensor(place_of(surface, flow, scales)),
        tensor(pressure_on(surface, scales, level)),
        lower=tensor(points.min(axis=0)),
        upper=tensor(points.max(axis=0)),
        between=tensor(points[:0]),
        strip=tensor(points[:0]),
        equation_weights=tensor(points[:0, 0]),
        wall_points=tensor(points[:0]),
        wall_velocity=tensor(velocity[:0]),
    )
    for name, values in training.arrays().items():
        if not torch.isfinite(values).all():
            raise FlowFileError(
                f"{name.replace('_', ' ')} must be finite as {dtype} in dimensionless units, got "
                "an overflow: check the units and the values of the flow"
            )
    return training


def test_grid(flow: Flow, scales: Scales) -> TestGrid:
    """All points with c = 1, for scoring and for maps of the fields."""
    frame, row, column = indices = _indices(flow.material)
    points = scales.points_to_dimensionless(flow.x[column], flow.y[row], flow.t[frame])
    return TestGrid(torch.as_tensor(points), indices)


def turned_and_rounded(values: Float64, axes: Axes) -> Float64:
    """Vectors [n, 2] or points [n, 3] in the axes of the training, multiples of `RESOLUTION`."""
    turned = np.stack([*axes.turn(*values.T[:2]), *values.T[2:]], -1)
    return np.asarray(np.rint(turned / RESOLUTION) * RESOLUTION)


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


def _indices(mask: Bool) -> Indices:
    frame, row, column = np.nonzero(mask)
    return frame, row, column


def samples_of(flow: Flow) -> Particles:
    """The vectors after the start, in the units of the file; on a grid in the order (t, y, x).

    A uniform standard deviation does not change the weights and is left out.
    """
    particles = flow.particles
    if particles is not None:
        kept = flow.after_start(particles.t)
        found = {name: None if a is None else a[kept] for name, a in vars(particles).items()}
    else:
        kept = flow.valid & flow.after_start(flow.t)[:, None, None]
        frame, row, column = _indices(kept)
        fields = {name: getattr(flow, name) for name in ("u", "v", *_sigmas_of(flow))}
        found = {name: np.broadcast_to(a, kept.shape)[kept] for name, a in fields.items()}
        found |= {"t": flow.t[frame], "y": flow.y[row], "x": flow.x[column]}
    if not kept.any():
        raise FlowFileError(
            "c, u and v must hold valid vectors where c = 1 at t > 0, got none: start the clock "
            "at the release of the grains"
            if particles is None
            else "particles/t must hold times after 0, got none: start the clock at the release "
            "of the grains"
        )
    return Particles(**found)  # type: ignore[arg-type]


def _sigmas_of(flow: Flow) -> tuple[str, ...]:
    """Names of the standard deviations; none if both are uniform."""
    varies = isinstance(flow.sigma_u, np.ndarray) or isinstance(flow.sigma_v, np.ndarray)
    return ("sigma_u", "sigma_v") if varies else ()


def _velocity_weights(samples: Particles) -> Float64:
    """Weights by the measurement (data/noise.py); 1 everywhere without standard deviations."""
    if samples.sigma_u is None or samples.sigma_v is None:
        return np.ones(samples.t.size)
    return velocity_weights(variance(samples.sigma_u, samples.sigma_v))


def place_of(surface: Surface, flow: Flow, scales: Scales) -> Float64:
    """Points of a free surface as (x, y, t) of the training [M, 3]."""
    points = scales.points_to_dimensionless(surface.x, surface.y, surface.t)
    return turned_and_rounded(points, axes_of(flow))


def pressure_on(surface: Surface, scales: Scales, level: str) -> Float64:
    """The dimensionless pressure on a free surface [M]."""
    if level != "V2" or surface.p is None:
        return np.zeros(surface.t.size)
    return scales.to_dimensionless(surface.p.astype(np.float64), "pressure")


def surface_of(flow: Flow, level: str) -> Surface:
    """The points of the free surface that a level uses: after the start and above the toe."""
    surface = outline(flow) if level == "V0" else flow.surface
    if surface is None:
        raise FlowFileError(
            f"level {level} needs the free surface, got no surface_t, surface_x, surface_y: add "
            "them or use level V0; a flow without any free surface needs a wall with wall_p there"
        )
    if level == "V2" and surface.p is None:
        raise FlowFileError(
            "level V2 needs the pressure on the free surface, got no surface_p: add it or use "
            "level V1"
        )
    return usable(surface, flow, level)


def usable(surface: Surface, flow: Flow, level: str) -> Surface:
    """The points of `surface_of` among those of a surface."""
    kept = flow.after_start(surface.t)
    if level != "V2" and surface.t.size and not flow.periodic:
        h = flow.height(surface.x, surface.y)
        kept &= h > h.min() + TOE_GRAINS * flow.grain_diameter
    if not kept.any() and level != "V0":
        raise FlowFileError(
            f"level {level} needs points of the free surface at t > 0 and more than "
            f"{TOE_GRAINS:g} grain diameters above the lowest of them, got none: add more of "
            "the surface or use level V0"
        )
    return chosen(surface, kept)
