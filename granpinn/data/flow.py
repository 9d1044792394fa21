"""A measured or simulated granular flow in memory, in the units of its file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Bool, Float32, Float64, Floats, Index, plain_array
from granpinn.declared import require_fields
from granpinn.errors import BadInput
from granpinn.output.table import Table
from granpinn.physics.law_values import LawValues

# Numbers of the material in any units; float32 holds all of them.
LEAST, LARGEST = 1e-30, 1e30
# among the attributes
STEADY, PERIOD_X, SURFACE_SD, WALL_GAP = "steady", "period_x", "surface_sd", "wall_gap"
WINDOW = "interrogation_window"  # side of the squares over which each vector is a mean
SOLVER_CELL = "grid_spacing_of_solver"
SOLVER_MEAN = "averaging_length_of_solver"  # of the strain rate in its friction law


# (x, y, t), each [n], to the force per mass (S_x, S_y), each [n]
Source = Callable[[Float64, Float64, Float64], tuple[Float64, Float64]]


class FlowFileError(BadInput):
    """A flow breaks a rule of the format; the message is one sentence with the remedy."""


class _Record:
    """Fields of the types that they declare."""

    def __post_init__(self) -> None:
        require_fields(self, FlowFileError)


@dataclass(frozen=True, eq=False)
class Surface(_Record):
    """Points of the free surface, in any order.

    Attributes:
        t, x, y: time and position, [n].
        p: measured pressure there, [n], or None; used at level V2 only.
    """

    t: Float64
    x: Float64
    y: Float64
    p: Float32 | None = None


@dataclass(frozen=True, eq=False)
class Walls(_Record):
    """Walls, obstacles and plates as polylines.

    The points of a piece lie in order along it. A point with x and y of NaN separates two pieces.

    Attributes:
        x, y: positions [m].
        u, v: velocity of the wall at its points [m], None = at rest.
        slip: [m], 0 where grains move with the wall, 1 where none flow through it and nothing more
            is known; None = 1.
        p: measured normal stress on the wall [m]; NaN or None = not known.
    """

    x: Float64
    y: Float64
    u: Float64 | None = None
    v: Float64 | None = None
    slip: Float32 | None = None
    p: Float32 | None = None


@dataclass(frozen=True, eq=False)
class Particles(_Record):
    """Scattered vectors, one per grain and time, in any order.

    Attributes:
        t, x, y: time and position, [n] float64.
        u, v: velocity, [n] float32 or float64; every vector is valid.
        sigma_u, sigma_v: standard deviation of u and v, [n] float32, or None.
    """

    t: Float64
    x: Float64
    y: Float64
    u: Floats
    v: Floats
    sigma_u: Float32 | None = None
    sigma_v: Float32 | None = None


class Truth(LawValues):
    """The friction law that made the data: for scoring, never for training."""


@dataclass(frozen=True)
class Units:
    """Units of length, time and density of a flow file; "1" means dimensionless."""

    length: str
    time: str
    density: str | None = None

    def of(self, kind: str) -> str | None:
        """Unit of a kind of quantity; None for pressure and viscosity unless all units are SI.

        A flow file may lack the unit of its density, which determines the unit of pressure.
        """
        if kind == "number" or self.length == self.time == "1":
            return "1"
        si = (self.length, self.time, self.density) == ("m", "s", "kg/m^3")
        return {
            **({"pressure": "Pa", "viscosity": "Pa s"} if si else {}),
            "length": self.length,
            "time": self.time,
            "velocity": f"{self.length}/{self.time}",
            "rate": f"1/{self.time}",
        }.get(kind)


@dataclass(frozen=True, eq=False)
class Flow(_Record):
    """Velocity of the grains on a grid in space and time, or at scattered points.

    In a flow with `particles` the scattered vectors are the measurement. Then t, y, x, u, v, c are
    only a view of them on a grid, for figures (`particle_flow` makes it).

    Attributes:
        t, y, x: time [T] and cell centers [Y], [X]; x to the right, y up.
        u, v: velocity [T, Y, X], float32 or float64; NaN where there is no valid vector, never 0.
        c: volume fraction of grains [T, Y, X], 0 to 1; data points are those with c = 1,
            and in training partly filled ones under the surface (`outline.py`).
        gravity: (g_x, g_y).
        density: bulk density of the grains, for the momentum equation.
        grain_diameter: mean diameter d of the grains.
        length_unit, time_unit: names of the units, "1" = dimensionless.
        density_unit: name of the unit of density, None if unknown.
        grain_density: density of a grain, for the inertial number; None = `density`.
        p: reference pressure [T, Y, X]: for scoring, never for training.
        surface: observed points of the free surface.
        walls: walls that touch the grains, None if the file states none.
        sigma_u, sigma_v: standard deviation of u and v, one number or [T, Y, X].
        particles: scattered vectors.
        eta_max, eta_min: bounds of the viscosity in the solver that made the data.
        truth: friction law of the material, None if unknown.
        attributes: further attributes of the file, such as its source. `steady` is 1 if all frames
            show one flow; `period_x` is the length of the period along x, in the unit of x;
            `surface_sd` is the standard deviation of an offset of the surface line, likewise;
            `wall_gap` the distance between side walls, through one of which the grains are seen.
        layer: whether the data alone show that the flow is the same along x, without `period_x`
            (`symmetry.with_layer`); no part of a file.
        averaged: number of frames whose mean the flow is (`steady_mean`); no part of a file.
        source: force per mass beside gravity at any point, in the units and axes of the flow, for
            manufactured flows (bench/studies/floor); no part of a file.
        every: every how many frames of a large flow this one has (`large.thinned`); no part of a
            file.
        sha256: hash of the file that was read, "" for a flow made in memory.
        path: the file that was read.
    """

    t: Float64
    y: Float64
    x: Float64
    u: Floats
    v: Floats
    c: Float32
    gravity: tuple[float, float]
    density: float
    grain_diameter: float
    length_unit: str = "1"
    time_unit: str = "1"
    density_unit: str | None = None
    grain_density: float | None = None
    p: Float32 | None = None
    surface: Surface | None = None
    walls: Walls | None = None
    sigma_u: float | Float32 | None = None
    sigma_v: float | Float32 | None = None
    particles: Particles | None = None
    eta_max: float | None = None
    eta_min: float | None = None
    truth: Truth | None = None
    attributes: dict[str, Any] = field(default_factory=dict)
    layer: bool = False
    averaged: int = 1
    source: Source | None = None
    every: int = 1
    sha256: str = ""
    path: Path | None = None

    @property
    def material(self) -> Bool:
        """Cells that hold nothing but grains, c = 1: [T, Y, X].

        A fraction above 1 is the rounding error of a solver; `check_flow` bounds it.
        """
        material: Bool = self.c >= 1
        return material

    @property
    def valid(self) -> Bool:
        """Cells of `material` with a finite velocity vector: [T, Y, X]."""
        return self.valid_in(slice(None))

    def valid_in(self, frames: slice | int | Index) -> Bool:
        """`valid` in one frame [Y, X] or in some [K, Y, X]."""
        grains: Bool = self.c[frames] >= 1
        return grains & np.isfinite(self.u[frames]) & np.isfinite(self.v[frames])

    def height(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Float64:
        """Height of points above the origin, measured against gravity: -(g . r)/|g|."""
        g_x, g_y = self.gravity
        x, y = (plain_array(a, name).astype(np.float64) for name, a in (("x", x), ("y", y)))
        return np.asarray(-(g_x * x + g_y * y) / math.hypot(g_x, g_y))

    @property
    def spacing(self) -> tuple[float, float]:
        """Usual distances of columns and of rows: the medians along x and y."""
        return float(np.median(np.diff(self.x))), float(np.median(np.diff(self.y)))

    @property
    def units(self) -> Units:
        """Its units of length, time and density."""
        return Units(self.length_unit, self.time_unit, self.density_unit)

    @property
    def steady(self) -> bool:
        """Whether all frames show one and the same flow: it is stated, or there is one frame."""
        return self.t.size == 1 or self.attributes.get(STEADY) == 1

    @property
    def periodic(self) -> bool:
        """Whether the flow repeats along x: the file states `period_x`, or the flow is a layer."""
        return self.layer or self.stated(PERIOD_X) is not None

    @property
    def of_solver(self) -> bool:
        """Whether a solver made the data, as the file states; else they are of real grains."""
        return any(self.stated(name) is not None for name in (SOLVER_CELL, SOLVER_MEAN))

    def after_start(self, t: npt.NDArray[np.floating[Any]]) -> Bool:
        """Whether data at the times t [n] count: those with t > 0, or all of a steady flow.

        A flow that is not steady starts at t = 0, and the pressure of its initial state is a guess.
        """
        return np.ones(t.shape, bool) if self.steady else np.asarray(t > 0)

    def stated(self, name: str) -> float | None:
        """A positive number among `attributes`; None if there is none of that name."""
        value = self.attributes.get(name)
        if isinstance(value, (int, float, np.number)) and LEAST <= value <= LARGEST:
            return float(value)
        return None

    def described(self) -> dict[str, str]:
        """Size, extent and material in words, by their names."""
        length, time = (f" {u}" if u != "1" else "" for u in (self.length_unit, self.time_unit))
        span = f"{self.t[0]:.4g} to {self.t[-1]:.4g}{time}"
        if self.particles is None:
            count = sum(int(self.valid_in(k).sum()) for k in range(self.t.size))
            vectors = f"{self.y.size} x {self.x.size} grid, {count} in the grains"
        else:
            vectors = f"{self.particles.u.size} scattered"
        x, y = ((float(axis.min()), float(axis.max())) for axis in (self.x, self.y))
        surface = "none (level V0)" if self.surface is None else f"{self.surface.t.size} points"
        found = {
            "source": self.path.name if self.path else "in memory",
            "time": "steady" if self.steady else span,
            "frames": str(self.t.size),
            "vectors": vectors,
            "extent": f"x {x[0]:.4g} to {x[1]:.4g}, y {y[0]:.4g} to {y[1]:.4g}{length}",
            "grain diameter": f"{self.grain_diameter:.4g}{length}",
            "bulk density": f"{self.density:.4g} {self.density_unit or ''}".strip(),
            "gravity": f"({self.gravity[0]:.4g}, {self.gravity[1]:.4g})",
            "free surface": surface,
        }
        if self.walls is not None:
            found["walls"] = f"{int(np.isfinite(self.walls.x).sum())} points"
        if self.p is not None:
            found["reference pressure"] = "for scoring, not for training"
        return found

    def __repr__(self) -> str:
        """One line: source, time, frames, vectors and free surface."""
        texts = self.described()
        shown = ("time", "frames", "vectors", "free surface")
        found = "; ".join(f"{name}: {texts[name]}" for name in shown)
        return f"Flow({texts['source']}; {found})"

    def _repr_html_(self) -> str:
        """The facts as a table, for notebooks."""
        return Table((), [*self.described().items()]).html()
