"""What the conservation of mass says about the components of a velocity and its units.

- **Volume.** Dense grains keep their volume: u_x + v_y = 0. With u and v swapped, the file has
  u_y + v_x = 0 instead; with one of them mirrored, u_x - v_y = 0; with x (or u) off by a factor,
  v_y / -u_x is that factor. White noise makes all of these sums equally large and correlates no
  two gradients: nothing is found. Solid rotation has u_y + v_x = 0 too. Hence a swap also needs a
  squared divergence above half of all squared gradients, which is that of unrelated components.
- **Center of mass.** If no grains cross the edges of the grid, the center of mass of c moves with
  the mean velocity: X(t_2) - X(t_1) = integral of <u> dt, and the same in y. The ratio is 1 in
  any unit. The error of <u> by missing vectors is a share of the rms of u, so only a body whose
  mean velocity is a large share of that rms can answer; a drum, a chute and a bed at rest cannot.
  A wrong sign makes the ratio negative. If only v in place of u gives 1, they are swapped.

The scatter is that of blocks of frames: a statement must hold in each of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.data import Flow

BLOCKS = 4  # every fourth interval, or row of vectors, shifted by one from frame to frame
FEWEST_INTERVALS, FEWEST_VECTORS = 8, 25
# A hypothesis wins if it halves the rms of the divergence.
GAIN = 0.5
# Correlation at which errors change a ratio of rms values by less than 1 / 0.7.
CORRELATED = 0.7
# The center of mass: correlation, flux across the edges over the largest inside, <u> over rms(u).
FOLLOWS, CLOSED, MOVES = 0.9, 0.25, 0.2


@dataclass(frozen=True)
class Volume:
    """What the gradients say: None where they do not decide.

    Attributes:
        swapped, mirrored: u and v are swapped; one of them has the wrong sign.
        ratio: rms(v_y) / rms(u_x), if they are correlated.
    """

    swapped: bool = False
    mirrored: bool = False
    ratio: float | None = None


@dataclass(frozen=True)
class Center:
    """Motion of the center of mass.

    Attributes:
        ratio: signed (integral of the mean velocity) / displacement in x and y; None: not known.
        closed: whether no grains cross the edges of the grid.
        rise: height that the center of mass gains, over the height H of the grains.
    """

    ratio: tuple[float | None, float | None]
    closed: bool
    rise: float

    @property
    def ratios(self) -> list[float]:
        """The known ones."""
        return [ratio for ratio in self.ratio if ratio is not None]

    @property
    def follows(self) -> bool:
        """Whether it is known to move along the velocity in x and y."""
        return len(self.ratios) == 2 and min(self.ratios) > 0


def volume_of(flow: Flow, u: Float64, v: Float64) -> Volume:
    """Compares the divergence with that of the hypotheses.

    Args:
        u, v: velocity of some frames [K, Y, X], NaN where there is no vector.
    """
    width, depth = flow.x[2:] - flow.x[:-2], (flow.y[2:] - flow.y[:-2])[:, None]
    u_x, v_x = ((a[:, 1:-1, 2:] - a[:, 1:-1, :-2]) / width for a in (u, v))
    u_y, v_y = ((a[:, 2:, 1:-1] - a[:, :-2, 1:-1]) / depth for a in (u, v))
    inside = np.isfinite(u_x) & np.isfinite(u_y)
    frame, row = np.ogrid[: len(u), : inside.shape[1]]
    blocks = [
        _block(inside & ((frame + row) % BLOCKS == k)[:, :, None], u_x, u_y, v_x, v_y)
        for k in range(BLOCKS)
    ]
    n, xx, yx, xy, yy, normal, shear = np.array(blocks).T
    if not ((n >= FEWEST_VECTORS) & (xx + yy > 0)).all():
        return Volume()
    divergence, all_gradients = xx + yy + 2 * normal, xx + yx + xy + yy

    def wins(other: Float64) -> bool:
        return bool((other < GAIN**2 * divergence).all())

    across = bool((shear < -CORRELATED * np.sqrt(yx * xy)).all())
    large = bool((divergence > all_gradients / 2).all())
    swapped = across and large and wins(yx + xy + 2 * shear)
    r = normal / np.sqrt(xx * yy)
    mirrored = bool((r > CORRELATED).all())
    related = mirrored or bool((r < -CORRELATED).all())
    return Volume(
        swapped=swapped,
        mirrored=mirrored,
        ratio=math.sqrt(yy.sum() / xx.sum()) if related else None,
    )


def _block(there: Bool, *gradients: Float64) -> list[float]:
    """Number of vectors of a block, sums of u_x^2, u_y^2, v_x^2, v_y^2, u_x v_y and u_y v_x.

    `a @ b` would wait for the threads of BLAS: 7 ms for each of these sums.
    """
    u_x, u_y, v_x, v_y = (a[there] for a in gradients)
    pairs = ((u_x, u_x), (u_y, u_y), (v_x, v_x), (v_y, v_y), (u_x, v_y), (u_y, v_x))
    return [float(there.sum()), *(float(np.sum(a * b)) for a, b in pairs)]


def center_of(flow: Flow, frames: Index, u: Float64, v: Float64, height: float) -> Center:
    """Compares the motion of the center of mass with the mean velocity.

    Args:
        u, v: velocity of the frames [K, Y, X], NaN where there is no vector.
    """
    valid = np.isfinite(u)
    w_x, w_y = np.gradient(flow.x), np.gradient(flow.y)
    c, t = flow.c[frames].astype(np.float64), flow.t[frames]
    profiles = (np.einsum("kyx,y->kx", c, w_y) * w_x, np.einsum("kyx,x->ky", c, w_x) * w_y)
    places = [
        (grains @ axis) / grains.sum(axis=1)
        for grains, axis in zip(profiles, (flow.x, flow.y), strict=True)
    ]
    area = np.where(valid, w_y[:, None] * w_x, 0.0)
    ratios, closed = [], []
    for place, values, side, axis in ((places[0], u, w_y, 2), (places[1], v, w_x, 1)):
        values = np.where(valid, values, 0.0)
        sums = np.einsum("kyx,y->kx" if axis == 2 else "kyx,x->ky", values, side)
        flux = np.abs(sums)
        shut = bool(flux[:, [0, -1]].sum() <= CLOSED * flux.max(axis=1).sum())
        mean = (values * area).sum(axis=(1, 2)) / area.sum(axis=(1, 2))
        square = (values**2 * area).sum() / area.sum()
        closed.append(shut)
        moves = shut and np.mean(mean**2) > MOVES**2 * square
        ratios.append(_ratio(np.diff(place), _integrals(mean, t)) if moves else None)
    levels = flow.height(*places)
    rise = float(levels[-1] - levels[0]) / height
    return Center((ratios[0], ratios[1]), all(closed), rise)


def _integrals(mean: Float64, t: Float64) -> Float64:
    return np.asarray((mean[1:] + mean[:-1]) / 2 * np.diff(t))


def _ratio(moved: Float64, expected: Float64) -> float | None:
    """The signed ratio of rms(expected) and rms(moved); None if they are not proportional.

    The center of mass of a mask moves in steps, so the intervals become longer until it shows.
    """
    while moved.size >= FEWEST_INTERVALS:
        blocks = [(moved[k::BLOCKS], expected[k::BLOCKS]) for k in range(BLOCKS)]
        aa, bb, ab = np.array([(a @ a, b @ b, a @ b) for a, b in blocks]).T
        r = ab / np.sqrt(aa * bb)  # NaN if one is 0
        if (r > FOLLOWS).all() or (r < -FOLLOWS).all():
            return float(np.sign(r[0]) * math.sqrt(bb.sum() / aa.sum()))
        even = moved.size // 2 * 2
        moved, expected = (a[:even].reshape(-1, 2).sum(axis=1) for a in (moved, expected))
    return None
