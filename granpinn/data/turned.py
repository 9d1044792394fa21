"""A flow turned by quarters until gravity points mostly down, so that columns run along y."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from granpinn.data.flow import PERIOD_X, Flow, Surface, Walls

Points = TypeVar("Points", Surface, Walls)


def quarters(flow: Flow) -> int:
    """Turns until gravity points down within 45 degrees, 0 to 3; 0 for the gravity (0, -1)."""
    g_x, g_y = flow.gravity
    if abs(g_y) >= abs(g_x):
        return 0 if g_y < 0 else 2
    return 1 if g_x > 0 else 3


def vector(x: Any, y: Any, k: int) -> tuple[Any, Any]:
    """Components (x, y) in axes that are turned by k quarters."""
    return ((x, y), (y, -x), (-x, -y), (-y, x))[k % 4]


def points(some: Points, k: int) -> Points:
    """Points of the surface or of walls in axes that are turned by k quarters."""
    changes = dict(zip("xy", vector(some.x, some.y, k), strict=True))
    if isinstance(some, Walls) and some.u is not None:
        changes |= zip("uv", vector(some.u, some.v, k), strict=True)
    return replace(some, **changes)


def grid(values: Any, k: int) -> Any:
    """Values [T, Y, X] in the order of axes that are turned by k quarters."""
    return np.rot90(values, k, axes=(1, 2))


def upright(flow: Flow) -> Flow:
    """The vectors, surface and walls of a flow on a grid, turned by its `quarters`.

    Only along the x of its file a flow has a period.
    """
    k = quarters(flow)
    if k == 0:
        return flow
    u, v = vector(flow.u, flow.v, k)
    sigmas = {"sigma_u": flow.sigma_u, "sigma_v": flow.sigma_v}
    if k % 2:
        sigmas = {"sigma_u": flow.sigma_v, "sigma_v": flow.sigma_u}
    arrays = {"u": u, "v": v, "c": flow.c, "p": flow.p, **sigmas}
    x, y = vector(flow.x, flow.y, k)
    return replace(
        flow,
        x=np.sort(x),
        y=np.sort(y),
        gravity=vector(*flow.gravity, k),
        surface=None if flow.surface is None else points(flow.surface, k),
        walls=None if flow.walls is None else points(flow.walls, k),
        attributes={name: a for name, a in flow.attributes.items() if name != PERIOD_X},
        layer=False,
        **{n: grid(a, k) if isinstance(a, np.ndarray) else a for n, a in arrays.items()},
    )
