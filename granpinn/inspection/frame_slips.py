"""Slips of time: frames twice, frames that are missing, and a steady flow that changes."""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.data import Flow
from granpinn.inspection.body import Body
from granpinn.results.slip import IMPROBABLE, Slip

MANY = 0.1  # of the frames; fewer are an advice of the inspection
UNSTEADY = 0.01  # of gravity, the acceleration of a flow that is stated as steady
# A jump of the center of mass: over the way of the mean velocity, over the scatter of all other
# intervals, and over the spacing. One lost frame adds one such way; half of it is nearer to one
# than to none. A level top that sinks below a row of the grid moves the center by half a spacing,
# and so does an upright side: together by 0.71.
JUMP, SCATTER, SPACING = 0.5, 10.0, 0.75
FEWEST_FRAMES = 4
SOME = 8  # every so-many-th row


def repeated(flow: Flow) -> list[Slip]:
    """Many frames with the vectors of the frame before, unless nothing moves or nothing changes."""
    if flow.steady:
        return []
    pairs = zip(flow.u[1:], flow.u[:-1], flow.v[1:], flow.v[:-1], strict=True)
    same = [
        k
        for k, (u, u_0, v, v_0) in enumerate(pairs, 1)
        if _equal(u[::SOME], u_0[::SOME])  # most frames differ in these rows
        and _equal(u, u_0)
        and _equal(v, v_0)
        and (np.nan_to_num(u).any() or np.nan_to_num(v).any())
    ]
    if len(same) <= MANY * flow.t.size or len(same) == flow.t.size - 1:
        return []
    return [
        Slip(
            IMPROBABLE,
            f"{len(same)} of {flow.t.size} frames repeat the one before (first: frame "
            f"{same[0] + 1}, t = {flow.t[same[0]]:.4g}): leave them out, and check the frame rate",
        )
    ]


def _equal(a: Floats, b: Floats) -> bool:
    return np.array_equal(a, b, equal_nan=True)


def missing(flow: Flow, body: Body) -> list[Slip]:
    """An interval in which the center of mass of a closed flow moves far more than its velocity."""
    if flow.steady or body.t.size < FEWEST_FRAMES:
        return []
    step = np.diff(body.t)[:, None]
    way = (body.velocity[1:] + body.velocity[:-1]) / 2 * step
    rest = np.hypot(*(np.diff(body.place, axis=0) - way).T)
    k = int(np.argmax(rest))
    scatter = SCATTER * float(np.median(rest))
    least = max(JUMP * _size(way[k]), scatter, SPACING * body.spacing)
    if not rest[k] > least:
        return []
    moved, expected = _size(np.diff(body.place, axis=0)[k]), _size(way[k])
    return [
        Slip(
            IMPROBABLE,
            f"between frames {k + 1} and {k + 2} (t = {body.t[k]:.4g}) the center of mass moves "
            f"{moved / expected:.2g} times as far as its velocity takes it, and not between the "
            "others: frames are missing there, or are out of order",
        )
    ]


def _size(vector: Float64) -> float:
    return math.hypot(*map(float, vector))


def unsteady(flow: Flow) -> list[Slip]:
    """A steady flow whose mean velocity changes from its first to its last frame."""
    duration = float(flow.t[-1] - flow.t[0])
    both = flow.valid_in(0) & flow.valid_in(-1)
    if not flow.steady or duration <= 0 or not both.any():
        return []
    change = [float(np.mean(a[-1][both] - a[0][both], dtype=np.float64)) for a in (flow.u, flow.v)]
    part = math.hypot(*change) / duration / math.hypot(*flow.gravity)
    if part <= UNSTEADY:
        return []
    text = (
        "the flow is stated as steady, but from its first to its last frame the mean velocity "
        f"changes as by an acceleration of {part:.1%} of gravity, which the equations lack: mu "
        f"will be wrong by about {part:.2g}; average later frames, or give all frames without "
        "`steady`"
    )
    return [Slip(IMPROBABLE, text)]
