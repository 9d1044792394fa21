"""Slips of unit, sign, size and order in a flow file, seen from what physics fixes.

All checks compare the flow with itself, so they need no model and no training. Each is a function
in the table `CHECKS`. Of some, the first one that finds a slip hides the later ones, as it explains
them.

Scattered vectors are compared with gravity on their view, and not with each other.
"""

from __future__ import annotations

import warnings
from functools import cached_property

import numpy as np

from granpinn.arrays import Float64, Index
from granpinn.data import Flow, FlowFileError, FlowFileWarning
from granpinn.data.large import slabs
from granpinn.data.scaling import initial_height
from granpinn.inspection.body import Body, body_of
from granpinn.inspection.conservation import Center, center_of, volume_of
from granpinn.inspection.frame_slips import missing, repeated, unsteady
from granpinn.inspection.gravity_slips import gravity_slips
from granpinn.inspection.motion_slips import CENTER_DIFFERS, beyond, motion_slips
from granpinn.inspection.size_slips import against_fall, size_slips
from granpinn.inspection.statement_slips import statement_slips
from granpinn.inspection.surface_slips import surface_slips
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, SEVERITIES, Slip

# Frames are taken evenly from the whole flow, so many at most, and fewer of a large grid.
MOST_FRAMES, FEWEST_FRAMES, MOST_CELLS = 48, 16, 1_000_000
RISE = 0.1  # of the height of the grains


class Seen:
    """A flow, with what its checks share; each is made when it is first asked for."""

    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self.gridded = flow.particles is None
        self.free = flow.source is None  # gravity is the only force

    @cached_property
    def height(self) -> float:
        """Extent along gravity of all places that held grains, in the unit of the file."""
        flow = self.flow
        if flow.particles is not None:
            places = flow.height(flow.particles.x, flow.particles.y)
        else:
            grains = np.any([(flow.c[k] >= 1).any(axis=0) for k in slabs(flow)], 0)
            rows, columns = np.nonzero(grains)
            places = flow.height(flow.x[columns], flow.y[rows])
        return max(float(np.ptp(places)), initial_height(flow))

    @cached_property
    def vectors(self) -> tuple[Index, Float64, Float64]:
        """Some frames, and their u and v [K, Y, X], NaN where there is no vector."""
        flow = self.flow
        size = int(np.clip(MOST_CELLS // flow.c[0].size, FEWEST_FRAMES, MOST_FRAMES))
        frames = np.unique(np.linspace(0, flow.t.size - 1, size).round().astype(int))
        valid = flow.valid_in(frames)
        u, v = (np.where(valid, a[frames], np.nan).astype(np.float64) for a in (flow.u, flow.v))
        return frames, u, v

    @cached_property
    def speeds(self) -> Float64:
        """Speeds of the vectors of some frames, or of all scattered ones [n]."""
        if self.flow.particles is not None:
            return np.hypot(self.flow.particles.u, self.flow.particles.v, dtype=np.float64)
        _, u, v = self.vectors
        speeds = np.hypot(u, v)
        return np.asarray(speeds[np.isfinite(speeds)])

    @cached_property
    def center(self) -> Center:
        """The motion of the center of mass."""
        return center_of(self.flow, *self.vectors, self.height)

    @cached_property
    def body(self) -> Body:
        return body_of(self.flow)


def motion(seen: Seen) -> list[Slip]:
    """u, v, t, x and y must fit each other."""
    if not seen.gridded:
        return []
    flow, center = seen.flow, seen.center
    frames, u, v = seen.vectors
    volume = volume_of(flow, u, v)
    swapped = volume.swapped
    if not (swapped or center.follows):
        other = center_of(flow, frames, v, u, seen.height)
        swapped = other.follows and not any(beyond(r, CENTER_DIFFERS) for r in other.ratios)
    if swapped:
        text = "grains keep their volume and move with their velocity only if u and v, or the "
        return [Slip(IMPOSSIBLE, f"{text}axes x and y of the arrays, are swapped: swap them back")]
    covered = float(np.isfinite(u).sum() / flow.c[frames].sum(dtype=np.float64))
    return motion_slips(volume, center, covered)


def lost_frames(seen: Seen) -> list[Slip]:
    """No frames are missing."""
    return missing(seen.flow, seen.body) if seen.gridded and seen.center.closed else []


def fall(seen: Seen) -> list[Slip]:
    """The fall of the grains and their energy must fit gravity."""
    if not seen.free:
        return []
    return gravity_slips(seen.flow, seen.body, seen.height, seen.center.closed)


def rise(seen: Seen) -> list[Slip]:
    """A closed flow with no moving walls never raises its center of mass."""
    center = seen.center
    if not (seen.free and center.closed and center.rise > RISE):
        return []
    text = (
        f"the center of mass rises by {center.rise:.0%} of the height of the grains, and without "
        "moving walls it can only fall: check the signs of gravity, y and v"
    )
    return [Slip(IMPROBABLE, text)]


def surface(seen: Seen) -> list[Slip]:
    """The grains must be under the surface line, and run downhill there."""
    return surface_slips(seen.flow) if seen.free else []


def speed(seen: Seen) -> list[Slip]:
    """No grains are much faster than a free fall."""
    if not seen.free:
        return []
    return against_fall(seen.flow, seen.speeds, seen.height, seen.center.closed)


def frames(seen: Seen) -> list[Slip]:
    """No frame repeats another, and a flow that is said to be steady is."""
    return repeated(seen.flow) + unsteady(seen.flow) if seen.gridded else []


def sizes(seen: Seen) -> list[Slip]:
    """Grains, solid fraction and gravity have usual sizes."""
    return size_slips(seen.flow)


def statements(seen: Seen) -> list[Slip]:
    """What the file states must be within what the flow bounds."""
    return statement_slips(seen.flow, seen.speeds)


def explanation(seen: Seen) -> list[Slip]:
    """What the first of these checks finds, since it explains what those after it would find."""
    kinds = (motion, lost_frames, fall, rise, surface, speed)
    return next((found for check in kinds if (found := check(seen))), [])


CHECKS = (frames, explanation, sizes, statements)


def slips(flow: Flow) -> list[Slip]:
    """Slips of a flow, the most certain first; none in sound data."""
    seen = Seen(flow)
    with np.errstate(all="ignore"):  # what is not finite decides nothing
        found = [slip for check in CHECKS for slip in check(seen)]
    return sorted(found, key=lambda slip: SEVERITIES.index(slip.severity))


def refuse_slips(flow: Flow) -> list[Slip]:
    """Refuses impossible data, and warns of other slips with a FlowFileWarning.

    Raises:
        FlowFileError: for the first impossible slip.
    """
    name = "" if flow.path is None else f"{flow.path}: "
    found = slips(flow)
    for slip in found:
        if slip.severity == IMPOSSIBLE:
            raise FlowFileError(f"{name}{slip.text}")
        warnings.warn(f"{name}{slip.text}", FlowFileWarning, stacklevel=3)
    return found


def warn_of_slips(flow: Flow) -> list[Slip]:
    """Warns of all slips with a FlowFileWarning."""
    found = slips(flow)
    for slip in found:
        warnings.warn(str(slip), FlowFileWarning, stacklevel=3)
    return found
