"""The frames: twice, empty, without vectors, or changing where they are steady."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Floats
from granpinn.data import Flow
from granpinn.data.large import slabs
from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, IMPROBABLE, Check, Reason, Record

MANY = 0.1  # of the frames repeat the one before; fewer are an advice
UNSTEADY = 0.01  # of gravity, the acceleration of a flow that is stated as steady
POOR = 0.5  # share of the grains of a frame that have vectors
SOME = 8  # rows are compared at this stride first


@dataclass(frozen=True)
class Frames(Record):
    """
    Attributes:
        repeated: frames with the vectors of the frame before; none of a steady flow or particles.
        poor: frames without vectors in half of the grains; none of particles.
        empty: number of frames without grains between frames with grains.
        acceleration: of the mean velocity of a flow that is stated as steady, over gravity.
    """

    title = "frames"

    count: int
    repeated: tuple[int, ...]
    poor: tuple[int, ...]
    empty: int
    acceleration: float

    @property
    def words(self) -> str:
        return f"{self.count}, {len(self.repeated)} repeated, {len(self.poor)} mostly empty"

    def reasons(self, of: Inspection) -> list[Reason]:
        found, t, repeated = [], of.filmed.t, len(self.repeated)
        if repeated > MANY * self.count:
            k = self.repeated[0]
            text = (
                f"{repeated} of {self.count} frames repeat the one before (first: frame {k + 1}, "
                f"t = {t[k]:.4g}): leave them out, and check the frame rate"
            )
            found.append(Reason(IMPROBABLE, text))
        for frames, what in (
            (self.repeated if repeated <= MANY * self.count else (), "repeat the one before"),
            (self.poor, "lack vectors in more than half of the grains"),
        ):
            if frames:
                first = f"t = {t[frames[0]]:.4g}{of.time_unit}"
                text = f"{len(frames)} frames {what} (first: {first}): leave them out."
                found.append(Reason(ADVICE, text))
        if self.acceleration > UNSTEADY:
            part = self.acceleration
            text = (
                "the flow is stated as steady, but from its first to its last frame the mean "
                f"velocity changes as by an acceleration of {part:.1%} of gravity, which the "
                f"equations lack: mu will be wrong by about {part:.2g}; average later frames, or "
                "give all frames without `steady`"
            )
            found.append(Reason(IMPROBABLE, text))
        if self.empty:
            text = (
                f"{self.empty} frames between others hold no grains (c = 1 nowhere): leave them "
                "out, or give their fraction"
            )
            found.append(Reason(IMPROBABLE, text))
        return found


def make(inspection: Inspection) -> Frames:
    flow = inspection.filmed
    scattered = flow.particles is not None
    grains, seen = _cells(flow)
    full = np.flatnonzero(grains)
    return Frames(
        count=flow.t.size,
        repeated=() if flow.steady or scattered else _repeated(flow),
        poor=() if scattered else tuple(map(int, np.flatnonzero(seen < POOR * grains))),
        empty=int(full[-1] - full[0] + 1 - full.size) if full.size else 0,
        acceleration=_acceleration(flow),
    )


def _cells(flow: Flow) -> tuple[Floats, Floats]:
    """Numbers of cells full of grains, and of those that have a vector, in each frame [T]."""
    parts = []
    for k in slabs(flow):
        parts.append([a.sum(axis=(1, 2)) for a in (flow.c[k] >= 1, flow.valid_in(k))])
    grains, seen = (np.concatenate(part) for part in zip(*parts, strict=True))
    return grains, seen


def _repeated(flow: Flow) -> tuple[int, ...]:
    """Frames with the vectors of the frame before; none where nothing moves or changes."""
    pairs = zip(flow.u[1:], flow.u[:-1], flow.v[1:], flow.v[:-1], strict=True)
    same = [
        k
        for k, (u, u_0, v, v_0) in enumerate(pairs, 1)
        if _equal(u[::SOME], u_0[::SOME])  # most frames differ in these rows
        and _equal(u, u_0)
        and _equal(v, v_0)
        and (np.nan_to_num(u).any() or np.nan_to_num(v).any())
    ]
    return tuple(same) if len(same) < flow.t.size - 1 else ()


def _equal(a: Floats, b: Floats) -> bool:
    return np.array_equal(a, b, equal_nan=True)


def _acceleration(flow: Flow) -> float:
    """Change of the mean velocity of a steady flow over its time and gravity; 0 of other flows."""
    duration = float(flow.t[-1] - flow.t[0])
    if not flow.steady or duration <= 0 or flow.particles is not None:
        return 0.0
    both = flow.valid_in(0) & flow.valid_in(-1)
    if not both.any():
        return 0.0
    change = [float(np.mean(a[-1][both] - a[0][both], dtype=np.float64)) for a in (flow.u, flow.v)]
    return math.hypot(*change) / duration / math.hypot(*flow.gravity)


CHECK = Check("frames", Frames, make, seconds=0.01)
