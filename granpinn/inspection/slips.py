"""Slips of unit, sign, size and order in a flow file, seen from what physics fixes.

All checks compare the flow with itself, so they need no model and no training. The first kind that
finds a slip is shown, since it explains the kinds after it:

1. u, v, t, x and y must fit each other (motion_slips.py).
2. No frames are missing (frame_slips.py).
3. The fall of the grains and their energy must fit gravity (gravity_slips.py).
4. A closed flow with no moving walls never raises its center of mass.
5. The grains must be under the surface line, and run downhill there (surface_slips.py).
6. No grains are much faster than a free fall (size_slips.py).

Repeated frames, sizes and what the file states (statement_slips.py) are checked in any case.
"""

from __future__ import annotations

import warnings

import numpy as np

from granpinn.arrays import Float64, Index
from granpinn.data import Flow, FlowFileError, FlowFileWarning
from granpinn.data.large import slabs
from granpinn.data.scaling import initial_height
from granpinn.inspection.body import body_of
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


def slips(flow: Flow) -> list[Slip]:
    """Slips of a flow, the most certain first; none in sound data.

    Scattered vectors are compared with gravity on their view, and not with each other.
    """
    with np.errstate(all="ignore"):  # what is not finite decides nothing
        return sorted(_slips(flow), key=lambda slip: SEVERITIES.index(slip.severity))


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


def _slips(flow: Flow) -> list[Slip]:
    height, gridded = _height(flow), flow.particles is None
    frames, u, v = _vectors(flow)
    center, body = center_of(flow, frames, u, v, height), body_of(flow)
    found = _of_motion(flow, frames, u, v, center, height) if gridded else []
    found = found or (missing(flow, body) if gridded and center.closed else [])
    if flow.source is None:  # else gravity is not the only force
        found = found or gravity_slips(flow, body, height, center.closed) or _rise(center)
        found = found or surface_slips(flow)
        found = found or against_fall(flow, _speeds(flow, u, v), height, center.closed)
    always = repeated(flow) + unsteady(flow) if gridded else []
    stated = statement_slips(flow, _speeds(flow, u, v))
    return [*always, *found, *size_slips(flow), *stated]


def _vectors(flow: Flow) -> tuple[Index, Float64, Float64]:
    """Some frames, and their u and v [K, Y, X], NaN where there is no vector."""
    size = int(np.clip(MOST_CELLS // flow.c[0].size, FEWEST_FRAMES, MOST_FRAMES))
    frames = np.unique(np.linspace(0, flow.t.size - 1, size).round().astype(int))
    valid = flow.valid_in(frames)
    u, v = (np.where(valid, a[frames], np.nan).astype(np.float64) for a in (flow.u, flow.v))
    return frames, u, v


def _speeds(flow: Flow, u: Float64, v: Float64) -> Float64:
    """Speeds of the vectors of some frames, or of all scattered ones."""
    if flow.particles is not None:
        return np.hypot(flow.particles.u, flow.particles.v, dtype=np.float64)
    speeds = np.hypot(u, v)
    return np.asarray(speeds[np.isfinite(speeds)])


def _of_motion(
    flow: Flow, frames: Index, u: Float64, v: Float64, center: Center, height: float
) -> list[Slip]:
    """Slips of u, v, t, x and y against each other."""
    volume = volume_of(flow, u, v)
    swapped = volume.swapped
    if not (swapped or center.follows):
        other = center_of(flow, frames, v, u, height)
        swapped = other.follows and not any(beyond(r, CENTER_DIFFERS) for r in other.ratios)
    if swapped:
        text = "grains keep their volume and move with their velocity only if u and v, or the "
        return [Slip(IMPOSSIBLE, f"{text}axes x and y of the arrays, are swapped: swap them back")]
    covered = float(np.isfinite(u).sum() / flow.c[frames].sum(dtype=np.float64))
    return motion_slips(volume, center, covered)


def _height(flow: Flow) -> float:
    """Extent along gravity of all places that held grains, in the unit of the file."""
    if flow.particles is not None:
        places = flow.height(flow.particles.x, flow.particles.y)
    else:
        rows, columns = np.nonzero(np.any([(flow.c[k] >= 1).any(axis=0) for k in slabs(flow)], 0))
        places = flow.height(flow.x[columns], flow.y[rows])
    return max(float(np.ptp(places)), initial_height(flow))


def _rise(center: Center) -> list[Slip]:
    """A closed flow whose grains end higher than they started."""
    if not (center.closed and center.rise > RISE):
        return []
    return [
        Slip(
            IMPROBABLE,
            f"the center of mass rises by {center.rise:.0%} of the height of the grains, and "
            "without moving walls it can only fall: check the signs of gravity, y and v",
        )
    ]
