r"""Tables of tracked particles (PTV), and the velocities of tracks.

Columns by name, in any order, units in brackets if at all, such as `x [mm]`:

- x, y; and frame, or t (time);
- particle (also id, track, trajectory): the number of the track;
- or u, v (also vx, vy): velocities of the tracking program, with sigma_u, sigma_v;
- ep: trackpy's uncertainty of the position.

trackpy counts in pixels and frames, with y down. In TrackMate's tables y is down in any unit.

Velocities of tracks come from parabolas $x(\tau) = a + b \tau + c \tau^2$ through the positions
within a window of frames around each; $a$ is the position and $b$ the velocity. With the standard
deviation $\epsilon$ of a position (`ep`, or the scatter about all parabolas)
$\sigma_b^2 = \epsilon^2 (A^T A)^{-1}_{bb}$. At the ends of a track the window is one-sided and
$\sigma_b$ larger. The error of the parabola itself is not in $\sigma_b$.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.columns import (
    GROUPS,
    read_headed,
    require,
    require_finite,
    units_of,
)
from granpinn.importers.limits import COPIES, require_room
from granpinn.importers.vectors import (
    TRACK_WINDOW,
    DataFileError,
    VectorFields,
)

_TRACKPY = {"mass", "ecc", "raw_mass", "signal", "size"}
ORDER = 2
MAX_WINDOW = 501  # frames
_PER_PLACE = 12  # numbers for each observation and frame of the window, at the peak
_SMALLEST_SIGMA = 1e-12  # of the velocities: exact tracks have no scatter


def read(path: Path, window: int) -> VectorFields:
    """Scattered vectors of all tracks.

    Args:
        window: frames of the local polynomial, an odd number; not used if the table has u, v.
    """
    table = read_headed(path, ("x", "y"))
    found, stated = table.columns, table.units
    names = {column.name for column in table.named}
    missing = [] if {"frame", "t"} & found.keys() else ["frame (or t)"]
    missing += [] if "particle" in found or {"u", "v"} <= found.keys() else ["particle (or u, v)"]
    require(path, table.named, missing)
    image = len(_TRACKPY & names) >= 2
    down = image or "position_x" in names
    require_finite(path, found, nan=True)
    if image and not stated.keys() & GROUPS["length_unit"]:
        stated = stated | {"x": "px"}
    units, facts = units_of(path, stated), {}
    units["time_unit"] = units["time_unit"] if "t" in found else "frame"
    t, motion = found["t" if "t" in found else "frame"], dict[str, Any]()
    if "u" in found and "v" in found:
        motion |= {n: found[n] for n in ("x", "y", "u", "v", "sigma_u", "sigma_v") if n in found}
    else:
        _require_each_once(path, found)
        ep = found.get("ep")
        ep = ep if ep is not None and np.isfinite(ep).any() else None
        count = found["frame"] if "frame" in found else counted(t, found["particle"])
        motion |= velocities(t, count, found["x"], found["y"], found["particle"], ep, window)
        known = (units["length_unit"], units["time_unit"])
        units["velocity_unit"] = None if None in known else "/".join(map(str, known))
        facts = {TRACK_WINDOW: str(window)}
    finite = np.asarray(np.isfinite([motion["x"], motion["y"], t]).all(axis=0))
    if not finite.any():
        raise DataFileError(f"{path} holds no particle with a position and a time: export it again")
    # The order of the rows in the file must not matter: equal vectors give equal flows.
    keys = [*(motion[name] for name in "vuyx"), found.get("particle", t), t]
    order = np.lexsort(keys)
    order = order[finite[order]]
    return VectorFields(
        **{name: part[order] for name, part in (motion | {"t": t}).items()},
        **units,
        y_down=True if down else None,
        facts=facts,
    )


def _require_each_once(path: Path, columns: Mapping[str, Float64]) -> None:
    """Refuses several rows for one particle and time."""
    time = "frame" if "frame" in columns else "t"
    particle, frame = columns["particle"], columns[time]
    order = np.lexsort((frame, particle))
    again = (np.diff(particle[order]) == 0) & (np.diff(frame[order]) == 0)
    if again.any():
        row = order[1:][again][0]
        raise DataFileError(
            f"{path} must have one row for every particle and {time}, got particle "
            f"{particle[row]:g} more than once at {time} {frame[row]:g}, and {int(again.sum())} "
            "such rows: link the particles again, or keep the first row of each"
        )


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
) -> dict[str, Float64]:
    """x, y, u, v, sigma_u, sigma_v of every observation [n], in the order given.

    Velocities are NaN where a track is too short. There are no standard deviations without `ep` if
    the parabolas leave no scatter.

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
    require_room(t.size * window * _PER_PLACE / COPIES, "the table of tracks")
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
    found, scatter = {}, []
    for name, speed, values in (("x", "u", x), ("y", "v", y)):
        centered = np.where(inside, values[index] - values[:, None], 0.0)
        fit = np.einsum("nij,nwj,nw->ni", inverse, powers, centered)
        residual = centered - np.einsum("nwi,ni->nw", powers, fit)
        scatter.append((residual**2).sum(axis=1))
        found[name] = np.where(enough, values + fit[:, 0], values)
        found[speed] = np.where(enough, fit[:, 1] / unit, np.nan)
    freedom = np.where(enough, inside.sum(axis=1) - ORDER - 1, 0).sum()
    # Grains that never move along an axis have no scatter there.
    fastest = float(np.nanmax(np.abs([found["u"], found["v"]]), initial=0.0))
    least = _SMALLEST_SIGMA * max(fastest, 1e-300)
    for name, about in zip(("sigma_u", "sigma_v"), scatter, strict=True):
        if ep is None and freedom == 0:
            continue
        variance = about[enough].sum() / freedom if ep is None else np.square(ep[order])
        found[name] = np.maximum(np.sqrt(variance * b_variance), least)
    back = np.argsort(order)
    return {name: values[back] for name, values in found.items()}
