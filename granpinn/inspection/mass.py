r"""The conservation of mass: the components of a velocity, time and space must fit each other.

- **Volume.** Dense grains keep their volume: u_x + v_y = 0. With u and v swapped, the file has
  u_y + v_x = 0 instead; with one of them mirrored, u_x - v_y = 0; with x (or u) off by a factor,
  v_y / -u_x is that factor. White noise makes all of these sums equally large and correlates no
  two gradients: nothing is found. Solid rotation has u_y + v_x = 0 too. Hence a swap also needs a
  squared divergence above half of all squared gradients, which is that of unrelated components.
- **Center of mass.** If no grains cross the edges of the grid, the center of mass of c moves with
  the mean velocity: X(t_2) - X(t_1) = integral of <u> dt, and the same in y. The ratio is 1 in
  any unit. The error of <u> by missing vectors is a share of the rms of u, so only a body whose
  mean velocity is a large share of that rms can answer; a drum, a chute and a bed at rest cannot.
  A wrong sign makes the ratio negative. If only v in place of u gives 1, they are swapped. In one
  interval alone, it is a gap between two frames.

The scatter is that of blocks of frames: a statement must hold in each of them. The bounds:

- v_y and -u_x differ by a factor of 1.43 at most if noise leaves them correlated (CORRELATED); 1.6
  is improbable.
- The center of mass of c moves 0.7 to 1.05 times as far as the mean velocity takes it where
  vectors at fast edges are missing. 5 is improbable; 1.6 is, where nearly all grains have vectors
  and x and y agree. More than 10 is impossible.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.data import Flow
from granpinn.estimates.body import Body
from granpinn.inspection import Inspection, about
from granpinn.results.record import IMPOSSIBLE, IMPROBABLE, Check, Reason, Record

BLOCKS = 4  # every fourth interval, or row of vectors, shifted by one from frame to frame
FEWEST_INTERVALS, FEWEST_VECTORS = 8, 25
# A hypothesis wins if it halves the rms of the divergence.
GAIN = 0.5
# Correlation at which errors change a ratio of rms values by less than 1 / 0.7.
CORRELATED = 0.7
# The center of mass: correlation, flux across the edges over the largest inside, <u> over rms(u).
FOLLOWS, CLOSED, MOVES = 0.9, 0.25, 0.2
GRADIENTS_DIFFER, CENTER_DIFFERS, NO_ERROR = 1.6, 5.0, 10.0
# Both directions agree within the second factor, and so many grains have vectors.
BOTH_DIFFER, AGREE, COVERED = 1.6, 1.3, 0.8
# A jump of the center of mass: over the way of the mean velocity, over the scatter of all other
# intervals, and over the spacing. One lost frame adds 1 way: half of it decides. A level top that
# sinks below a row of the grid moves the center by half a spacing, and so does an upright side:
# together by 0.71.
JUMP, SCATTER, SPACING = 0.5, 10.0, 0.75
FEWEST_FRAMES = 4


@dataclass(frozen=True)
class Mass(Record):
    """What the volume and the center of mass say; None where they do not decide.

    Attributes:
        swapped: u and v, or x and y.
        mirrored: the gradients show that u or v has the wrong sign.
        gradients: rms(v_y) / rms(u_x), if they are correlated.
        ratio: signed (integral of the mean velocity) / displacement of the center in x and y.
        closed: whether no grains cross the edges of the grid.
        covered: share of the grains that have vectors.
        jump: the frame before the interval in which the center moves far more than its velocity,
            its time, and the way of the center over that of the velocity.
    """

    swapped: bool
    mirrored: bool
    gradients: float | None
    ratio: tuple[float | None, float | None]
    closed: bool
    covered: float
    jump: tuple[int, float, float] | None

    def reasons(self, of: Inspection) -> list[Reason]:
        if of.filmed.particles is not None:  # components of scattered vectors are not compared
            return []
        if self.swapped:
            text = (
                "grains keep their volume and move with their velocity only if u and v, or the "
                "axes x and y of the arrays, are swapped: swap them back"
            )
            return [Reason(IMPOSSIBLE, text)]
        return self._orientation() or self._factors() or self._gap()

    def _orientation(self) -> list[Reason]:
        """Components with the wrong sign."""
        mirrored = self.mirrored
        in_x, in_y = (None if ratio is None else ratio > 0 for ratio in self.ratio)
        if self.gradients is not None:  # the volume ties the sign of one component to the other
            in_x = (in_y != mirrored) if in_x is None and in_y is not None else in_x
            in_y = (in_x != mirrored) if in_y is None and in_x is not None else in_y
        if in_x is not False and in_y is not False:
            if not mirrored or in_x is not None:
                return []
            wrong = "u_x = +v_y where grains that keep their volume have u_x = -v_y: u or v"
            return [Reason(IMPOSSIBLE, f"{wrong} (or x or y) has the wrong sign")]
        where = "x and y" if in_x is in_y else "y" if in_x is not False else "x"
        cause = {
            "x": "u (or x) has the wrong sign",
            "y": "v (or y) is upside down",
            "x and y": "u and v have the wrong sign, or time runs backward",
        }[where]
        against = f"the center of mass moves against the velocity of the grains in {where}"
        return [Reason(IMPOSSIBLE, f"{against}: {cause}")]

    def _factors(self) -> list[Reason]:
        """Components, times and places in units that do not fit together."""
        gradients = self.gradients
        n = {axis: r for axis, r in zip("xy", self.ratio, strict=True) if r is not None}
        far = {axis: r for axis, r in n.items() if _beyond(r, CENTER_DIFFERS)}
        agree = len(n) == 2 and self.covered > COVERED and not _beyond(n["x"] / n["y"], AGREE)
        if not far and agree and all(_beyond(r, BOTH_DIFFER) for r in n.values()):
            far = n
        if far and (len(n) == 1 or not _beyond(n["x"] / n["y"], GRADIENTS_DIFFER)):
            ratio = math.exp(sum(map(math.log, n.values())) / len(n))
            parts = "u and v, t, or x and y"
        elif far:
            axis, ratio = max(far.items(), key=lambda item: abs(math.log(item[1])))
            parts = {"x": "u or x", "y": "v or y"}[axis]
        elif gradients is not None and _beyond(gradients, GRADIENTS_DIFFER):
            text = (
                f"v_y is {about(gradients)} -u_x, and they are equal if grains keep their volume: "
                "x and y, or u and v, are not in the same unit"
            )
            return [Reason(_grade(gradients), text)]
        else:
            return []
        frames = (
            "" if _beyond(ratio, CENTER_DIFFERS) else ", and whether frames are doubled or lost"
        )
        text = (
            f"the velocity integrated over time is {about(ratio)} the way of the center of mass: "
            f"check the units of {parts}{frames}"
        )
        return [Reason(_grade(ratio), text)]

    def _gap(self) -> list[Reason]:
        if self.jump is None:
            return []
        k, t, factor = self.jump
        text = (
            f"between frames {k + 1} and {k + 2} (t = {t:.4g}) the center of mass moves "
            f"{factor:.2g} times as far as its velocity takes it, and not between the others: "
            "frames are missing there, or are out of order"
        )
        return [Reason(IMPROBABLE, text)]


def _beyond(ratio: float, factor: float) -> bool:
    """Whether a ratio differs from 1 by more than a factor."""
    return not 1 / factor <= ratio <= factor


def _grade(ratio: float) -> str:
    return IMPOSSIBLE if _beyond(ratio, NO_ERROR) else IMPROBABLE


def make(inspection: Inspection) -> Mass:
    flow = inspection.filmed
    gridded = flow.particles is None
    frames, u, v = inspection.vectors
    swapped, mirrored, gradients = volume_of(flow, u, v)
    ratio, closed = center_of(flow, frames, u, v)
    if gridded and not (swapped or _follows(ratio)):
        other, _ = center_of(flow, frames, v, u)
        swapped = _follows(other) and not any(_beyond(r, CENTER_DIFFERS) for r in other if r)
    covered = float(np.isfinite(u).sum() / flow.c[frames].sum(dtype=np.float64))
    jump = jump_of(flow, inspection.body) if gridded and closed else None
    return Mass(swapped, mirrored, gradients, ratio, closed, covered, jump)


def _follows(ratio: tuple[float | None, float | None]) -> bool:
    """Whether the center of mass is known to move along the velocity in x and y."""
    return all(r is not None and r > 0 for r in ratio)


def jump_of(flow: Flow, body: Body) -> tuple[int, float, float] | None:
    """The interval in which the center of mass of a closed flow jumps, as in `Mass`."""
    if flow.steady or body.t.size < FEWEST_FRAMES:
        return None
    moved = np.diff(body.place, axis=0)
    way = (body.velocity[1:] + body.velocity[:-1]) / 2 * np.diff(body.t)[:, None]
    rest, size = np.hypot(*(moved - way).T), np.hypot(*way.T)
    k = int(np.argmax(rest))
    scatter = SCATTER * float(np.median(rest))
    if not rest[k] > max(JUMP * size[k], scatter, SPACING * body.spacing):
        return None
    return k, float(body.t[k]), float(np.hypot(*moved[k]) / size[k])


def volume_of(flow: Flow, u: Float64, v: Float64) -> tuple[bool, bool, float | None]:
    """`swapped`, `mirrored` and `gradients` of `Mass`: the divergence against hypotheses.

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
        return False, False, None
    divergence, all_gradients = xx + yy + 2 * normal, xx + yx + xy + yy

    def wins(other: Float64) -> bool:
        return bool((other < GAIN**2 * divergence).all())

    across = bool((shear < -CORRELATED * np.sqrt(yx * xy)).all())
    large = bool((divergence > all_gradients / 2).all())
    swapped = across and large and wins(yx + xy + 2 * shear)
    r = normal / np.sqrt(xx * yy)
    mirrored = bool((r > CORRELATED).all())
    related = mirrored or bool((r < -CORRELATED).all())
    return swapped, mirrored, math.sqrt(yy.sum() / xx.sum()) if related else None


def _block(there: Bool, *gradients: Float64) -> list[float]:
    """Number of vectors of a block, sums of u_x^2, u_y^2, v_x^2, v_y^2, u_x v_y and u_y v_x.

    `a @ b` would wait for the threads of BLAS: 7 ms for each of these sums.
    """
    u_x, u_y, v_x, v_y = (a[there] for a in gradients)
    pairs = ((u_x, u_x), (u_y, u_y), (v_x, v_x), (v_y, v_y), (u_x, v_y), (u_y, v_x))
    return [float(there.sum()), *(float(np.sum(a * b)) for a, b in pairs)]


def center_of(
    flow: Flow, frames: Index, u: Float64, v: Float64
) -> tuple[tuple[float | None, float | None], bool]:
    """`ratio` and `closed` of `Mass`: the center of mass against the mean velocity.

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
    return (ratios[0], ratios[1]), all(closed)


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


CHECK = Check("mass", Mass, make, seconds=0.05, explains=True)
