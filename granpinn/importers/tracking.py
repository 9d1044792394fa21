r"""Velocities of tracked particles by local polynomials over a few frames, with their uncertainty.

Around every observation of a track a parabola $x(\tau) = a + b \tau + c \tau^2$ is fitted to the
observations within the window; $a$ is the position and $b$ the velocity. With the uncertainty
$\epsilon$ of the positions (trackpy's `ep`, or the scatter about all parabolas)
$\sigma_b^2 = \epsilon^2 (A^T A)^{-1}_{bb}$. At the ends of a track the window is one-sided and
$\sigma_b$ larger. The error of the parabola itself is not in $\sigma_b$.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.limits import COPIES, require_room
from granpinn.importers.vectors import DataFileError

ORDER = 2
MAX_WINDOW = 501  # frames
_PER_PLACE = 12  # numbers for each observation and frame of the window, at the peak
_SMALLEST_SIGMA = 1e-12  # of the velocities: exact tracks have no scatter


class TrackMotion(NamedTuple):
    """Positions and velocities [n], NaN where a track is too short."""

    x: Float64
    y: Float64
    u: Float64
    v: Float64
    sigma_u: Float64 | None = None
    sigma_v: Float64 | None = None


def counted(t: Float64, particle: Float64) -> Float64:
    """Times [n] in usual steps of a track, so that a window counts frames in any unit of time."""
    order = np.lexsort((t, particle))
    steps = np.diff(t[order])[np.diff(particle[order]) == 0]
    steps = steps[steps > 0]
    return t / np.median(steps) if steps.size else t


def velocities(
    t: Float64,
    frame: Float64,
    x: Float64,
    y: Float64,
    particle: Float64,
    ep: Float64 | None,
    window: int,
) -> TrackMotion:
    """Position and velocity of every observation [n], in the order given.

    Args:
        t: time, or frame once more; one for each particle and frame.
        frame: numbers of the frames, which the window counts; or as `counted`.
        particle: number of the track; NaN = not on a track.
        ep: standard deviation of the position, or None.
        window: frames of the fit, odd and at least 3.
    """
    if window < ORDER + 1 or window % 2 == 0 or window > MAX_WINDOW:
        raise DataFileError(
            f"--track-window must be odd and at least 3, at most {MAX_WINDOW}, got {window}"
        )
    # These numbers exist once, and before the copies of the conversion.
    require_room(t.size * window * _PER_PLACE, 8 / COPIES, "the table of tracks")
    order = np.lexsort((frame, particle))
    t, frame, x, y, particle = (a[order] for a in (t, frame, x, y, particle))
    half = window // 2
    n = t.size
    index = np.arange(n)[:, None] + np.arange(-half, half + 1)
    inside = (index >= 0) & (index < n)
    index = np.clip(index, 0, n - 1)
    inside &= particle[index] == particle[:, None]
    inside &= (
        np.abs(frame[index] - frame[:, None]) <= half + 0.5
    )  # of a time that is no frame number
    inside &= np.isfinite(x[index] + y[index] + t[index])
    enough = inside.sum(axis=1) > ORDER
    # tau in units of the window, so that the normal equations are well conditioned.
    tau = np.where(inside, t[index] - t[:, None], 0.0)
    unit = np.abs(tau).max(axis=1)
    unit[unit == 0] = 1.0
    powers = np.where(inside[..., None], (tau / unit[:, None])[..., None] ** np.arange(3), 0.0)
    normal = np.einsum("nwi,nwj->nij", powers, powers)
    normal[~enough] = np.eye(3)
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        raise DataFileError(
            "a track must have another time in every frame, got one time for several: correct the "
            "columns t and frame"
        ) from None
    b_variance = inverse[:, 1, 1] / unit**2
    result, scatter = [], []
    for values in (x, y):
        centered = np.where(inside, values[index] - values[:, None], 0.0)
        fit = np.einsum("nij,nwj,nw->ni", inverse, powers, centered)
        residual = centered - np.einsum("nwi,ni->nw", powers, fit)
        scatter.append((residual**2).sum(axis=1))
        result.append(np.where(enough, values + fit[:, 0], values))
        result.append(np.where(enough, fit[:, 1] / unit, np.nan))
    freedom = np.where(enough, inside.sum(axis=1) - ORDER - 1, 0).sum()
    back = np.argsort(order)
    new_x, u, new_y, v = (a[back] for a in result)
    sigmas = []
    for about, velocity in zip(scatter, (u, v), strict=True):
        if ep is not None:
            variance = np.square(ep[order])
        elif freedom > 0:
            variance = np.full(n, about[enough].sum() / freedom)
        else:
            return TrackMotion(new_x, new_y, u, v)
        least = _SMALLEST_SIGMA * max(float(np.nanmax(np.abs(velocity), initial=0.0)), 1e-300)
        sigmas.append(np.maximum(np.sqrt(variance * b_variance), least)[back])
    return TrackMotion(new_x, new_y, u, v, *sigmas)
