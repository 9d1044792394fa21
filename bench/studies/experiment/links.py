"""The flows between the links of the experiment: what would be known if the rest lost nothing?

All have the axes, the grains and the material of the measured flow, and the reference pressure.
`python -m bench.studies.experiment.training DIR` identifies mu_s and mu_2 from every one.

| name | velocity | line of the surface |
|---|---|---|
| simulation | true, on the grid of the simulation | true |
| points | true, where PIV has a vector | true |
| points_picture_line | the same | from the pictures |
| points_mask_line | the same | edge of the mask at the vectors |
| window | mean of the true one over the grains in the window | true |
| piv_true_line | measured | true |
| piv_inner | measured, without windows that reach beyond the grains | from the pictures |
| piv_mask_line | measured | edge of the mask at the vectors |
| measured | measured | from the pictures |
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.studies.experiment.losses import on_grid, true_flow
from granpinn.data import Flow, Surface
from granpinn.importers.surface import from_fraction

if TYPE_CHECKING:
    from bench.studies.experiment.film import Film

Array = npt.NDArray[np.float64]
SIMULATION_STRIDE = 4  # cells of the simulation, and frames per pair
PARTS = 8  # of a window, along x and along y
WHOLE = 0.999  # of a window: all of it


def links(flow: Flow, measured: Flow, film: Film, window: int) -> dict[str, Flow]:
    """The flows by their names.

    Args:
        flow: the simulation, on every cell.
        window: interrogation window, px.
    """
    true = true_flow(measured, film.field)
    line = _at(flow.surface, measured.t)
    edge = from_fraction(
        measured.c.astype(np.float64), measured.t, measured.y, measured.x, measured.gravity
    )
    mean, full = window_mean(measured, film, window)
    p = on_grid(film.field.pressure, measured.t, measured.x, measured.y)
    known_p = np.where(measured.c == 1, p, np.nan).astype(np.float32)
    measured = replace(measured, p=known_p, truth=flow.truth)
    points = replace(measured, u=true.u, v=true.v)
    known = np.isfinite(measured.u)

    def where(kept: npt.NDArray[np.bool_], velocity: npt.NDArray[np.floating]) -> Flow:
        u, v = (np.where(kept, a, np.nan).astype(np.float32) for a in velocity)
        return replace(measured, u=u, v=v)

    return {
        "simulation": _thinned(flow),
        "points": replace(points, surface=line),
        "points_picture_line": points,
        "points_mask_line": replace(points, surface=edge),
        "window": replace(where(known, mean), surface=line),
        "piv_true_line": replace(measured, surface=line),
        "piv_inner": where(known & (full > WHOLE), np.stack([measured.u, measured.v])),
        "piv_mask_line": replace(measured, surface=edge),
        "measured": measured,
    }


def window_mean(measured: Flow, film: Film, window: int) -> tuple[Array, Array]:
    """True velocity [2, T, Y, X], mean over the grains in every window, and their share of it."""
    offsets = ((np.arange(PARTS) + 0.5) / PARTS - 0.5) * window * film.camera.pixel
    total: Array = np.zeros((2, *measured.u.shape))
    count = np.zeros(measured.u.shape)
    for dx in offsets:
        for dy in offsets:
            x, y = measured.x + dx, measured.y + dy
            inside = on_grid(film.field.fraction, measured.t, x, y) > 0.5
            inside &= (x > 0) & (y > 0)[:, None]
            total += inside * on_grid(film.field.velocity, measured.t, x, y)
            count += inside
    return total / np.maximum(count, 1), count / PARTS**2


def _at(line: Surface | None, times: Array) -> Surface:
    """The points of a line at some of its times."""
    assert line is not None
    kept = np.abs(line.t[:, None] - times).min(axis=1) < 1e-9 * times[-1]
    return Surface(line.t[kept], line.x[kept], line.y[kept])


def _thinned(flow: Flow) -> Flow:
    """Some cells and frames of the simulation, as many as a pair of pictures or so."""
    s = SIMULATION_STRIDE
    t, x, y = flow.t[s - 1 :: s], flow.x[::s], flow.y[::s]
    fields = {n: getattr(flow, n)[s - 1 :: s, ::s, ::s] for n in ("u", "v", "c", "p")}
    return replace(flow, t=t, x=x, y=y, surface=_at(flow.surface, t), **fields)
