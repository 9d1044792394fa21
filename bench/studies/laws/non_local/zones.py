"""Stress, strain rate and depth of a scene of grains, as two means over time.

The two means share no snapshots. So the noise of one is independent of that of the other, and
products of both have no bias by noise:

    gamma_dot^2 = 4 <D_1 : D_2> / 2,    |tau|^2 = <tau_1 : tau_2> / 2

A steady scene has two frames, which are these means. Of a scene with many frames, the blocks of
BLOCK frames are taken in turns, from a time on.

Errors are those of a jackknife over tiles of TILE x TILE grain diameters: neighboring cells share
force chains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.make import FLOW, REFERENCE
from bench.studies.grains.materials import I0
from bench.studies.grains.own_law import WINDOW
from granpinn.arrays import Bool, Float64
from granpinn.data import Flow, read_flow
from granpinn.estimates.quadratic_fits import smooth

BLOCK = 5  # frames
TILE = 8.0  # d
FEWEST_TILES = 3  # for a standard error
# From this time on the outflow of a silo and the speed of a chute hardly change.
SETTLED = {"silo": 10.0, "chute_slow": 100.0, "chute_fast": 100.0}
MIDDLE = {"drum": 14.0}  # half length of the slope over which the layers are parallel, d
HEIGHTS = (20.0, 45.0)  # of a silo, over which the profile from wall to centre is taken, d


@dataclass(frozen=True)
class Zones:
    """A scene on its cells [Y, X]; the first axis of tensors is the mean over time, the last has
    the components xx and xy (yy = -xx).

    Attributes:
        D, tau, p: strain rate, deviator [2, Y, X, 2] and pressure [2, Y, X].
        used: full cells away from walls with a strain rate, in both means.
        depth: distance from the place where the grains are driven or free: below the surface line,
            below the plate, or from the side walls of a silo.
        layers: cells whose layers of one depth are alike.
        tile: number of the tile of a cell.
        density: of a dense flow.
        truth: mu_s, mu_2 and I0 of the shear cell.
        free_surface: whether the file has a surface line.
    """

    name: str
    D: Float64
    tau: Float64
    p: Float64
    used: Bool
    depth: Float64
    layers: Bool
    tile: Float64
    density: float
    truth: dict[str, float]
    free_surface: bool

    @property
    def number(self) -> Float64:
        """I of the mean strain rate and the mean pressure [Y, X]."""
        mean = self.D.mean(axis=0)
        rate = 2 * np.hypot(mean[..., 0], mean[..., 1])
        with np.errstate(divide="ignore", invalid="ignore"):  # where there are no grains
            return np.asarray(rate * np.sqrt(self.density / self.p.mean(axis=0)))

    @property
    def along(self) -> Float64:
        """The deviator along the strain rate, tau : D/|D|, of the mean over time [Y, X]."""
        d, tau = self.D.mean(axis=0), self.tau.mean(axis=0)
        return np.asarray((tau * d).sum(axis=-1) / np.hypot(d[..., 0], d[..., 1]))


def cross(a: Float64) -> Float64:
    """|A|^2 = A:A/2 by the product of both means over time; negative where noise prevails."""
    return np.asarray((a[0] * a[1]).sum(axis=-1))


def zones_of(folder: Path) -> Zones:
    """The zones of a scene that `bench.studies.grains.make` has made.

    Raises:
        ExperimentError: the material has no shear cell.
    """
    flow = read_flow(folder / FLOW)
    with np.load(folder / REFERENCE) as stored:
        stress = {name: stored[name] for name in stored.files}
    groups = _groups(flow)
    xx, yy, xy, p = (_means(stress[k], groups) for k in ("sigma_xx", "sigma_yy", "sigma_xy", "p"))
    grains = np.stack([(flow.c[g] > 0.5).all(axis=0) for g in groups])
    u, v = (_means(np.asarray(a, np.float64), groups) for a in (flow.u, flow.v))
    grains &= np.isfinite(u) & np.isfinite(v)
    cell = float(flow.x[1] - flow.x[0])
    at_u, at_v = smooth(
        [u, v], grains.astype(float), (1.0, cell, cell), (0, *WINDOW[1:]), flow.periodic
    )
    D = np.stack([(at_u.x - at_v.y) / 2, (at_u.y + at_v.x) / 2], axis=-1)
    # Stress counts pressure as positive, so the deviator has the opposite sign.
    tau = -np.stack([(xx - yy) / 2, xy], axis=-1)
    if flow.attributes["scene"] == "silo":  # both halves as the right one
        side = np.sign(flow.x)
        D[..., 1], tau[..., 1] = side * D[..., 1], side * tau[..., 1]
    full = np.stack([stress["used"][g].all(axis=0) for g in groups])
    used = np.asarray(full.all(axis=0) & np.isfinite(D).all(axis=(0, -1)))
    depth, layers = _depth(flow, used)
    y, x = np.meshgrid(flow.y // TILE, flow.x // TILE, indexing="ij")
    truth = flow.truth
    if truth is None:
        raise ExperimentError(
            f"{folder} must have the law of its shear cell, got none: make it with "
            "bench.studies.grains.shear_cell, and the scene anew"
        )
    return Zones(
        folder.name,
        D,
        tau,
        p,
        used,
        depth,
        layers & used,
        1000 * y + x,
        flow.density,
        {"mu_s": truth.mu_s, "mu_2": truth.mu_2, "I0": I0},
        flow.surface is not None,
    )


def _groups(flow: Flow) -> list[Float64]:
    if len(flow.t) == 2:
        return [np.array([0]), np.array([1])]
    late = np.flatnonzero(flow.t >= SETTLED[str(flow.attributes["scene"])])
    turn = np.arange(len(late)) // BLOCK % 2
    return [late[turn == k] for k in range(2)]


def _means(field: Float64, groups: list[Float64]) -> Float64:
    return np.stack([field[g].mean(axis=0, dtype=np.float64) for g in groups])


def _depth(flow: Flow, used: Bool) -> tuple[Float64, Bool]:
    """Depth of the cells [Y, X], and those whose layers are parallel."""
    y, x = np.meshgrid(flow.y, flow.x, indexing="ij")
    scene = str(flow.attributes["scene"])
    if scene == "silo":
        return float(flow.attributes["wall_x"]) - np.abs(x), (y > HEIGHTS[0]) & (y < HEIGHTS[1])
    cell = float(flow.y[1] - flow.y[0])
    if flow.surface is None:  # below the plate
        return flow.y[used.any(axis=1)].max() + cell / 2 - y, np.ones_like(used)
    line, reach = flow.surface, MIDDLE.get(scene, np.inf)
    near = np.abs(line.x) < reach
    slope, height = np.polyfit(line.x[near], line.y[near], 1)
    cosine = 1 / np.hypot(1, slope)
    return cosine * (height + slope * x - y), np.abs(x + slope * (y - height)) * cosine < reach


def jackknife(
    value: Callable[[Bool], Float64 | float], tile: Float64, here: Bool
) -> tuple[Float64, Float64]:
    """A value of the cells `here` and its standard error, from leaving out one tile at a time.

    FEWEST_TILES and more are needed.
    """
    numbers = np.unique(tile[here])
    n = len(numbers)
    whole = np.asarray(value(here), dtype=np.float64)
    parts = np.stack([value(here & (tile != k)) for k in numbers])
    spread = (n - 1) / n * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0)
    return whole, np.asarray(np.sqrt(spread))
