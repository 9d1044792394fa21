"""A small analytic flow for tests: cheap, complete, and it keeps every rule of the format."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from granpinn.data import Flow, Particles, Surface, Truth, particle_flow


def make_flow(*, frames: int = 12, rows: int = 24, columns: int = 20, **changes: Any) -> Flow:
    r"""A heap that spreads like a collapsing column, in SI units (so that slips of unit show).

    With $R = R_0 (1 + 2 t^2)$, $a = \dot R / R$ and $b = 1/2$ the velocity
    $u = a x (1 + b y)$, $v = -a (y + b y^2 / 2)$ is free of divergence. The free surface is the
    quarter ellipse $h = H \sqrt{1 - x^2/R^2}$ with $H R$ constant, the pressure is hydrostatic.
    It solves no momentum equation: good for plumbing, not for identified values.

    Args:
        frames, rows, columns: size of the grid t in 0.1..1.0, y in 0..1.1, x in 0..2.
        changes: fields of the Flow to replace, for example `surface=None` or `gravity=(1, -9)`.
    """
    t = np.linspace(0.1, 1.0, frames)
    y = (np.arange(rows) + 0.5) * (1.1 / rows)
    x = (np.arange(columns) + 0.5) * (2.0 / columns)
    time, height, width = np.meshgrid(t, y, x, indexing="ij")
    spread = 1 + 2 * time**2
    strain_rate = 4 * time / spread
    surface_height = np.sqrt(np.clip(1 - (width / (0.6 * spread)) ** 2, 0, None)) / spread
    c = np.clip((surface_height - height) / (y[1] - y[0]) + 0.5, 0, 1)
    grains = c == 1
    u = np.where(grains, strain_rate * width * (1 + 0.5 * height), np.nan)
    v = np.where(grains, -strain_rate * (height + 0.25 * height**2), np.nan)
    p = 1500 * 9.81 * np.clip(surface_height - height, 0, None)
    line = surface_height[:, 0, :] > 0
    frame, column = np.nonzero(line)
    flow = Flow(
        t=t,
        y=y,
        x=x,
        u=u.astype(np.float32),
        v=v.astype(np.float32),
        c=c.astype(np.float32),
        p=p.astype(np.float32),
        gravity=(0.0, -9.81),
        density=1500.0,
        grain_diameter=0.025,
        length_unit="m",
        time_unit="s",
        surface=Surface(
            t=t[frame],
            x=x[column],
            y=surface_height[:, 0, :][line],
            p=np.zeros(frame.size, dtype=np.float32),
        ),
        eta_max=1e4,
        eta_min=1e-3,
        truth=Truth(mu_s=0.4, mu_2=0.64, I0=0.3),
        attributes={"source": "analytic spreading heap"},
    )
    return replace(flow, **changes)


def scattered(flow: Flow, **changes: Any) -> Flow:
    """The valid vectors of a flow on a grid as scattered ones; `changes`: of `particle_flow`."""
    k, j, i = np.nonzero(flow.valid)
    vectors = Particles(flow.t[k], flow.x[i], flow.y[j], flow.u[k, j, i], flow.v[k, j, i])
    names = ("gravity", "density", "grain_diameter", "length_unit", "time_unit", "surface")
    kept = {name: getattr(flow, name) for name in names}
    return particle_flow(**{"particles": vectors} | kept | changes)


def make_chute(*, frames: int = 1, rows: int = 14, columns: int = 16, **changes: Any) -> Flow:
    r"""A steady layer on a slope, periodic along x: Bagnold's flow, which solves all equations.

    At the slope $\tan\theta = \mu(I)$ with $I = 0.1$, dimensionless, with d = 1, h = 12 and
    $u = \frac{2 I}{3 d} \sqrt{g \cos\theta} (h^{3/2} - (h - y)^{3/2})$.

    Args:
        frames, rows, columns: size of the grid t from 5 on, y in 0..14, x in 0..32.
        changes: fields of the Flow to replace.
    """
    number, depth, law = 0.1, 12.0, Truth(mu_s=0.3, mu_2=0.7, I0=0.3)
    slope = 0.3 + 0.4 / (1 + 0.3 / number)
    down, into = np.array([slope, 1.0]) / np.hypot(slope, 1.0)
    t = 5.0 + 2.0 * np.arange(frames)
    y = (np.arange(rows) + 0.5) * (14.0 / rows)
    x = (np.arange(columns) + 0.5) * (32.0 / columns)
    below = np.clip(depth - y, 0, None)
    profile = 2 / 3 * number * np.sqrt(into) * (depth**1.5 - below**1.5)
    shape = (frames, rows, columns)
    full = np.broadcast_to((y + 7.0 / rows <= depth)[:, None], shape)
    u = np.where(full, np.broadcast_to(profile[:, None], shape), np.nan)
    time, place = (a.ravel() for a in np.meshgrid(t, x, indexing="ij"))
    flow = Flow(
        t=t,
        y=y,
        x=x,
        u=u.astype(np.float32),
        v=np.where(full, 0.0, np.nan).astype(np.float32),
        c=full.astype(np.float32),
        p=(into * np.broadcast_to(below[:, None], shape)).astype(np.float32),
        gravity=(float(down), -float(into)),
        density=1.0,
        grain_diameter=1.0,
        surface=Surface(t=time, x=place, y=np.full(place.size, depth)),
        truth=law,
        attributes={"period_x": 32.0} | ({"steady": 1} if frames > 1 else {}),
    )
    return replace(flow, **changes)


def make_channel(
    *, gap: float = 24.0, friction: float = 0.3, rows: int = 60, **changes: Any
) -> Flow:
    r"""A steady layer on a slope between side walls: the flow of Jop, Forterre and Pouliquen 2005.

    The weight gives $p = g z \cos\theta$ at the depth z. The walls carry a part of the stress, so
    that $\mu(I) = \tan\theta - \mu_w z / W$, from 0.5 at the surface to 0.35 at the base for the
    default walls. Dimensionless, with d = 0.5, 12 deep, without slip at its base.

    Args:
        gap, friction: W and mu_w of the walls that act; the file states W.
    """
    slope, depth, d, law = 0.5, 12.0, 0.5, Truth(mu_s=0.3, mu_2=0.7, I0=0.3)
    down, into = np.array([slope, 1.0]) / np.hypot(slope, 1.0)
    fine = np.linspace(0, depth, 20_001)
    below = depth - fine
    mu = slope - friction * below / gap
    rate = 0.3 * (mu - 0.3) / (0.7 - mu) * np.sqrt(into * below) / d
    speed = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2) * fine[1]])
    y = (np.arange(rows) + 0.5) * (14.0 / rows)
    x = np.arange(16) + 0.5
    shape = (1, rows, 16)
    full = np.broadcast_to((y + 7.0 / rows <= depth)[:, None], shape)
    u = np.broadcast_to(np.interp(y, fine, speed)[:, None], shape)
    p = into * np.broadcast_to(np.clip(depth - y, 0, None)[:, None], shape)
    flow = Flow(
        t=np.zeros(1),
        y=y,
        x=x,
        u=np.where(full, u, np.nan).astype(np.float32),
        v=np.where(full, 0.0, np.nan).astype(np.float32),
        c=full.astype(np.float32),
        p=p.astype(np.float32),
        gravity=(float(down), -float(into)),
        density=1.0,
        grain_diameter=d,
        surface=Surface(t=np.zeros(16), x=x, y=np.full(16, depth)),
        truth=law,
        attributes={"period_x": 16.0, "wall_gap": gap},
    )
    return replace(flow, **changes)
