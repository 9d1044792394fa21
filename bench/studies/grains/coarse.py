"""From grains to fields: coarse-graining with a Gaussian kernel.

    phi = sum_i A_i W_i / K    rho v = sum_i m_i v_i W_i / K    sigma = (virial + kinetic) / K

W_i = W(x - x_i): a Gaussian of sd 1 d, cut at 3 sd, whose integral is 1. K is the part of the
kernel within the container, so that fields do not fade at walls. Each grain carries its contact
stress (half of every contact) at its centre. Beside a plane of symmetry grains have mirror images;
in a periodic flow, periodic ones. The kinetic stress is that of the fluctuations,

    sum m v v W - rho V V - rho sd^2 (grad V)(grad V)^T ,

where the last term takes out what the gradient of the mean velocity adds within the kernel.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from bench.studies.grains.materials import DISKS
from bench.studies.grains.scenes.scene import Grid, Scene
from bench.studies.grains.simulation import Snapshot
from granpinn.arrays import Float64

SD = 1.0  # of the kernel, d
CUT = 3.0  # radius of the kernel, in SD
_NORM = 1 / (2 * np.pi * SD**2 * (1 - np.exp(-(CUT**2) / 2)))
XX, YY, XY = 0, 1, 2  # components of a stress


@dataclass(frozen=True)
class Fields:
    """Fields on cells, averaged over the snapshots of each frame.

    Attributes:
        t, y, x: mean time of each frame, cell centres: [T], [Y], [X].
        phi, rho, u, v: solid fraction, density, velocity, [T, Y, X]; velocity NaN without grains.
        stress: contact and kinetic stress, pressure positive, [T, Y, X, 3] (xx, yy, xy).
        coverage: part of the kernel within the container, [Y, X].
        bulk: solid fraction of a dense flow of these grains.
    """

    t: Float64
    y: Float64
    x: Float64
    phi: Float64
    rho: Float64
    u: Float64
    v: Float64
    stress: Float64
    coverage: Float64
    bulk: float = DISKS.fraction


def kernel(distance: Float64) -> Float64:
    """W at a distance, 1/d^2."""
    w = _NORM * np.exp(-0.5 * (distance / SD) ** 2)
    return np.asarray(np.where(distance <= CUT * SD, w, 0.0))


def centres(grid: Grid) -> tuple[Float64, Float64]:
    """Centres of the cells: y [Y], x [X]."""

    def axis(low: float, high: float) -> Float64:
        n = round((high - low) / grid.cell)
        return np.asarray(low + grid.cell * (np.arange(n) + 0.5), dtype=np.float64)

    return axis(grid.bottom, grid.top), axis(grid.left, grid.right)


def weights(px: Float64, py: Float64, y: Float64, x: Float64) -> csr_array:
    """W of every grain in every cell, [Y X, n]."""
    cell = x[1] - x[0]
    reach = int(CUT * SD / cell) + 1
    offsets = np.arange(-reach, reach + 1)
    i = np.rint((px - x[0]) / cell).astype(np.int64)[:, None, None] + offsets
    j = np.rint((py - y[0]) / cell).astype(np.int64)[:, None, None] + offsets[:, None]
    i, j = np.broadcast_arrays(i, j)
    n = np.broadcast_to(np.arange(len(px))[:, None, None], i.shape)
    kept = (i >= 0) & (i < len(x)) & (j >= 0) & (j < len(y))
    i, j, n = i[kept], j[kept], n[kept]
    w = kernel(np.hypot(px[n] - x[i], py[n] - y[j]))
    return csr_array((w, (j * len(x) + i, n)), shape=(len(y) * len(x), len(px)))


def coverage(scene: Scene, y: Float64, x: Float64) -> Float64:
    """K: part of the kernel around each cell within the container, [Y, X]."""
    step = (np.arange(30) + 0.5) / 15 - 1
    dy, dx = np.meshgrid(CUT * SD * step, CUT * SD * step, indexing="ij")
    w = kernel(np.hypot(dx, dy)).ravel()
    at_x = x[None, :, None] + dx.ravel()
    at_y = y[:, None, None] + dy.ravel()
    inside = np.broadcast_to(scene.inside(*np.broadcast_arrays(at_x, at_y)), (len(y), len(x), 900))
    return np.asarray((inside * w).sum(axis=2) / w.sum())


def columns(snapshot: Snapshot) -> tuple[Float64, Float64, Float64]:
    """x, y [n] and what the kernel averages: solid, m (1, u, v, uu, vv, uv), virial [n, 10]."""
    s = snapshot
    parts = [s.solid, s.mass, s.mass * s.vx, s.mass * s.vy]
    parts += [s.mass * s.vx**2, s.mass * s.vy**2, s.mass * s.vx * s.vy]
    return s.x, s.y, np.column_stack([*parts, s.virial])


_MIRRORED = np.array(
    [1, 1, -1, 1, 1, 1, -1, 1, 1, -1.0]
)  # signs of the columns in the mirror x = 0


def with_images(
    x: Float64, y: Float64, values: Float64, scene: Scene
) -> tuple[Float64, Float64, Float64]:
    """Grains and their images beside a plane of symmetry or the ends of a period."""
    margin = CUT * SD + scene.grid.cell
    copies = [(x, y, values)]
    if scene.mirror:
        near = x < margin
        copies.append((-x[near], y[near], values[near] * _MIRRORED))
    if scene.period is not None:
        x = x - scene.period * np.floor((x - scene.grid.left) / scene.period)
        copies = [(x + k * scene.period, y, values) for k in (-1, 0, 1)]
        kept = [
            (c > scene.grid.left - margin) & (c < scene.grid.right + margin) for c, _, _ in copies
        ]
        copies = [(a[k], b[k], c[k]) for (a, b, c), k in zip(copies, kept, strict=True)]
    a, b, c = (np.concatenate([copy[k] for copy in copies]) for k in range(3))
    return a, b, c


def coarse_grain(scene: Scene, snapshots: Iterable[Snapshot]) -> Fields:
    """The fields of a scene; frames whose mean time is below `dropped` are left out."""
    y, x = centres(scene.grid)
    group = scene.snapshots // scene.frames
    times: list[float] = []
    sums: list[Float64] = []
    for k, snapshot in enumerate(snapshots):
        frame = k // group
        if frame >= scene.frames:
            break
        px, py, values = with_images(*columns(snapshot), scene)
        total = np.asarray(weights(px, py, y, x) @ values) / group
        if frame == len(sums):
            times.append(0.0)
            sums.append(np.zeros_like(total))
        sums[frame] += total
        times[frame] += snapshot.t / group
    t = np.array(times)
    kept = t >= scene.dropped
    cover = coverage(scene, y, x)
    with np.errstate(divide="ignore", invalid="ignore"):
        means = np.stack(sums)[kept].reshape(-1, len(y), len(x), 10) / cover[:, :, None]
    return replace(_fields(t[kept], y, x, means, cover), bulk=scene.shape.fraction)


def _fields(t: Float64, y: Float64, x: Float64, means: Float64, cover: Float64) -> Fields:
    means = np.where(cover[:, :, None] > 0.3, means, 0.0)
    rho = means[..., 1]
    there = rho > 0.01
    u, v = (np.where(there, means[..., k] / np.where(there, rho, 1), np.nan) for k in (2, 3))
    steps = (y[1] - y[0], x[1] - x[0])
    slopes = [np.nan_to_num(g) for f in (u, v) for g in np.gradient(f, *steps, axis=(1, 2))]
    u_y, u_x, v_y, v_x = slopes
    spread = rho[..., None] * SD**2
    spread = spread * np.stack([u_x**2 + u_y**2, v_x**2 + v_y**2, u_x * v_x + u_y * v_y], axis=-1)
    mean = rho[..., None] * np.nan_to_num(np.stack([u * u, v * v, u * v], axis=-1))
    kinetic = means[..., 4:7] - mean - spread
    return Fields(t, y, x, means[..., 0], rho, u, v, means[..., 7:10] + kinetic, cover)
