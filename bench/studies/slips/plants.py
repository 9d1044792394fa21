"""The planted slips: each turns a sound flow into what a careless calibration makes of it.

Lengths are x, y and those of the surface line and of walls; the grain diameter and gravity are
given by hand and stay, unless a slip says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granpinn.data import Flow
from granpinn.data.flow import PERIOD_X

Change = Callable[[Flow], Flow]


@dataclass(frozen=True)
class Plant:
    """A slip with its group and the way it is made."""

    group: str
    name: str
    change: Change


def scaled(velocity: float = 1, t: float = 1, x: float = 1, y: float = 1) -> Change:
    """u and v, t, x and y times factors."""

    def change(flow: Flow) -> Flow:
        line, walls = flow.surface, flow.walls
        if line is not None:
            line = replace(line, t=line.t * t, x=line.x * x, y=line.y * y)
        if walls is not None:
            walls = replace(walls, x=walls.x * x, y=walls.y * y)
        period = flow.stated(PERIOD_X)
        given = {} if period is None else {PERIOD_X: period * x}
        return replace(
            flow,
            u=flow.u * velocity,
            v=flow.v * velocity,
            t=flow.t * t,
            x=flow.x * x,
            y=flow.y * y,
            surface=line,
            walls=walls,
            attributes=flow.attributes | given,
        )

    return change


def scale(factor: float) -> Change:
    """The size of a pixel."""
    return scaled(velocity=factor, x=factor, y=factor)


def rate(factor: float) -> Change:
    """The frame rate."""
    return scaled(velocity=factor, t=1 / factor)


def picture_upside_down(flow: Flow) -> Flow:
    """y and v of a picture whose y points down, taken as up; the line was found in the picture."""
    turned = _flipped_rows(flow)
    line = flow.surface
    if line is not None:
        turned = replace(turned, surface=replace(line, y=flow.y[0] + flow.y[-1] - line.y))
    return replace(turned, v=-turned.v)


def _flipped_rows(flow: Flow) -> Flow:
    y = flow.y[0] + flow.y[-1] - flow.y[::-1]
    return replace(flow, y=y, **{n: getattr(flow, n)[:, ::-1] for n in ("u", "v", "c")})


def turned_quarter(flow: Flow) -> Flow:
    """A picture from a camera on its side: x to y, y to -x."""
    line = flow.surface
    c = np.swapaxes(flow.c, 1, 2)[:, :, ::-1]
    u, v = (np.swapaxes(a, 1, 2)[:, :, ::-1] for a in (-flow.v, flow.u))
    x = -flow.y[::-1]
    if line is not None:
        line = replace(line, x=-line.y, y=line.x)
    given = _without_period(flow)
    return replace(flow, x=x, y=flow.x, u=u, v=v, c=c, surface=line, walls=None, attributes=given)


def _without_period(flow: Flow) -> dict[str, Any]:
    return {name: value for name, value in flow.attributes.items() if name != PERIOD_X}


def tilted(degrees: float) -> Change:
    """A camera that leans: gravity in its axes is turned."""

    def change(flow: Flow) -> Flow:
        (x, y), angle = flow.gravity, math.radians(degrees)
        cos, sin = math.cos(angle), math.sin(angle)
        return replace(flow, gravity=(cos * x - sin * y, sin * x + cos * y))

    return change


def transposed(flow: Flow) -> Flow:
    """x and y of the arrays swapped, with u and v as they are."""
    line = flow.surface
    new = {n: np.swapaxes(getattr(flow, n), 1, 2) for n in ("u", "v", "c")}
    line = None if line is None else replace(line, x=line.y, y=line.x)
    given = _without_period(flow)
    return replace(flow, x=flow.y, y=flow.x, surface=line, walls=None, attributes=given, **new)


def some_frames(k: np.ndarray, flow: Flow) -> Flow:
    """The frames k, as if they were taken at the first times of the flow."""
    if flow.steady:
        raise LookupError("the frames of a steady flow have no order")
    t = flow.t[0] + np.arange(len(k)) * float(np.diff(flow.t).mean())
    line = flow.surface
    if line is not None:
        frame = np.abs(line.t[:, None] - flow.t).argmin(axis=1)
        parts = [np.flatnonzero(frame == old) for old in k]
        points = np.concatenate(parts)
        times = np.repeat(t, [len(part) for part in parts])
        line = replace(line, t=times, x=line.x[points], y=line.y[points], p=None)
    return replace(flow, t=t, surface=line, **{n: getattr(flow, n)[k] for n in ("u", "v", "c")})


def doubled(flow: Flow) -> Flow:
    """Every frame twice, as in a film that was converted to twice the rate."""
    return some_frames(np.repeat(np.arange(flow.t.size), 2), flow)


def halved(flow: Flow) -> Flow:
    """Every second frame lost, with velocities as they are."""
    return some_frames(np.arange(0, flow.t.size, 2), flow)


def gap(flow: Flow) -> Flow:
    """A tenth of the frames lost in a row, a fifth after the beginning."""
    n = flow.t.size
    return some_frames(np.delete(np.arange(n), np.arange(n // 5, n // 5 + max(1, n // 10))), flow)


def backward(flow: Flow) -> Flow:
    """The frames in the reverse order, with velocities as they are."""
    return some_frames(np.arange(flow.t.size)[::-1], flow)


def surface(factor: float = 1.0, flip: bool = False, offset: float = 0.0) -> Change:
    """The line times a factor, upside down, or off by a part of the height of the picture."""

    def change(flow: Flow) -> Flow:
        line = flow.surface
        if line is None:
            raise LookupError("it has no surface line")
        low, high = flow.y[0], flow.y[-1]
        y = (low + high - line.y if flip else line.y) * factor + offset * (high - low)
        return replace(flow, surface=replace(line, x=line.x * factor, y=y))

    return change


def times_of_the_line(factor: float = 1.0, late: float = 0.0) -> Change:
    """The times of the line: of another frame rate, or late by a part of the film."""

    def change(flow: Flow) -> Flow:
        line, begin, end = flow.surface, float(flow.t[0]), float(flow.t[-1])
        if line is None or flow.steady:
            raise LookupError("it has no surface line with times")
        t = begin + factor * (line.t - begin) + late * (end - begin)
        kept = t <= end
        line = replace(line, t=t[kept], x=line.x[kept], y=line.y[kept], p=None)
        return replace(flow, surface=line)

    return change


def grains(factor: float) -> Change:
    """The grain diameter."""
    return lambda flow: replace(flow, grain_diameter=flow.grain_diameter * factor)


def gravity(factor: float) -> Change:
    """The size of gravity."""
    return lambda flow: replace(flow, gravity=(flow.gravity[0] * factor, flow.gravity[1] * factor))


def grain_density(factor: float) -> Change:
    """The density of a grain, as a factor of the bulk density."""
    return lambda flow: replace(flow, grain_density=flow.density * factor)


def _frames(flow: Flow) -> float:
    """Frames per unit of time."""
    if flow.steady:
        raise LookupError("the frames of a steady flow have no times")
    return (flow.t.size - 1) / float(flow.t[-1] - flow.t[0])


PLANTS = (
    Plant("scale", "scale x 10", scale(10)),
    Plant("scale", "scale / 10", scale(0.1)),
    Plant("scale", "scale x 2", scale(2)),
    Plant("scale", "scale / 2", scale(0.5)),
    Plant("rate", "frame rate x 10", rate(10)),
    Plant("rate", "frame rate / 10", rate(0.1)),
    Plant("rate", "frame rate x 2", rate(2)),
    Plant("rate", "frame rate / 2", rate(0.5)),
    Plant("unit", "x, y in cm taken as m", scaled(x=100, y=100)),
    Plant("unit", "x, y in mm taken as m", scaled(x=1000, y=1000)),
    Plant("unit", "x, y in px (of 0.15 mm) taken as m", scaled(x=6667, y=6667)),
    Plant("unit", "u, v in cm/s taken as m/s", scaled(velocity=100)),
    Plant(
        "unit",
        "u, v in px/frame (px of 0.15 mm) taken as m/s",
        lambda f: scaled(velocity=6667 / _frames(f))(f),
    ),
    Plant("unit", "t in frames taken as s", lambda f: scaled(t=_frames(f))(f)),
    Plant("unit", "half the pulse delay (u, v x 2)", scaled(velocity=2)),
    Plant("unit", "y in rows of two pixels (y / 2)", scaled(y=0.5)),
    Plant("direction", "picture upside down", picture_upside_down),
    Plant("direction", "sign of v", lambda f: replace(f, v=-f.v)),
    Plant("direction", "sign of u", lambda f: replace(f, u=-f.u)),
    Plant("direction", "picture turned by 90 degrees", turned_quarter),
    Plant("direction", "tilt of 5 degrees", tilted(5)),
    Plant("direction", "tilt of 10 degrees", tilted(-10)),
    Plant("direction", "u and v swapped", lambda f: replace(f, u=f.v, v=f.u)),
    Plant("direction", "x and y swapped", transposed),
    Plant("frames", "frames in reverse order", backward),
    Plant("frames", "every frame twice", doubled),
    Plant("frames", "every second frame lost", halved),
    Plant("frames", "a tenth of the frames lost in a row", gap),
    Plant("material", "grain diameter in mm taken as m", grains(1000)),
    Plant("material", "grain diameter / 10", grains(0.1)),
    Plant("material", "density of a grain in g/cm^3", grain_density(1e-3 / 0.6)),
    Plant("material", "gravity in mm/s^2 (x 1000)", gravity(1000)),
    Plant("surface", "line in other units (x 1000)", surface(factor=1000)),
    Plant("surface", "line a tenth of the picture too high", surface(offset=0.1)),
    Plant("surface", "line upside down", surface(flip=True)),
    Plant("surface", "line a tenth of the film late", times_of_the_line(late=0.1)),
    Plant("surface", "line of another frame rate (t x 1.25)", times_of_the_line(factor=1.25)),
)


def half_a_window(flow: Flow) -> Flow:
    """Vectors at the corners of their windows in place of the middles; the line stays."""
    half = [float(np.diff(axis).mean()) / 2 for axis in (flow.x, flow.y)]
    return replace(flow, x=flow.x + half[0], y=flow.y + half[1])


def mirrored(flow: Flow) -> Flow:
    """A picture seen from behind: x, u and the sideways part of gravity change sign."""
    line, walls = flow.surface, flow.walls
    return replace(
        flow,
        x=-flow.x[::-1],
        u=-flow.u[:, :, ::-1],
        v=flow.v[:, :, ::-1],
        c=flow.c[:, :, ::-1],
        gravity=(-flow.gravity[0], flow.gravity[1]),
        surface=None if line is None else replace(line, x=-line.x),
        walls=None if walls is None else replace(walls, x=-walls.x),
    )


# The same physics, or less of a change than the physics tells from another material.
HIDDEN = (
    Plant("hidden", "mirrored", mirrored),
    Plant("hidden", "vectors shifted by half a spacing", half_a_window),
    Plant("hidden", "grain diameter x 2", grains(2)),
    Plant("hidden", "solid fraction 0.5 for 0.6", grain_density(1 / 0.5)),
)
