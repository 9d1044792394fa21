"""Time in proportion: many small frames and repeated points cost no more than others."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, Surface
from granpinn.data.surface import outward_normals
from granpinn.fit.case import pose
from granpinn.inspection import inspect
from tests.flows import make_flow


def filmed(frames: int, side: int) -> Flow:
    """Frames of side x side vectors."""
    t, along = np.linspace(0, 10, frames), np.linspace(0.1, 0.3, side)
    T, Y, _ = np.meshgrid(t, along, along, indexing="ij")
    noise = 0.01 * np.random.default_rng(0).normal(size=(2, *T.shape))
    u, v = np.float32(np.sin(T) * Y + noise[0]), np.float32(noise[1])
    line = Surface(np.repeat(t, side), np.tile(along, frames), np.full(side * frames, 0.32))
    made = make_flow(t=t, x=along, y=along, u=u, v=v, c=np.ones_like(u), p=None, surface=line)
    return replace(made, grain_diameter=0.01)


def lined(distinct: bool, count: int = 300_000) -> Flow:
    """A surface line of so many points; if not distinct, nearly all repeat four of them."""
    flow = make_flow(frames=8, rows=27, columns=23)
    line = flow.surface
    assert line is not None
    n = line.t.size
    some = np.random.default_rng(0).integers(0, n if distinct else 4, count - n)
    k = np.concatenate([np.arange(n), some])
    moved = 1e-3 * np.linspace(0, distinct, count)
    return replace(flow, surface=Surface(line.t[k], line.x[k] + moved, line.y[k]))


def normals(flow: Flow) -> object:
    assert flow.surface is not None
    return outward_normals(flow, flow.surface)


def seconds(work: Callable[[Flow], object], flow: Flow) -> float:
    begin = time.process_time()
    work(flow)
    return time.process_time() - begin


@pytest.mark.parametrize(
    ("make", "usual", "work"),
    [
        (partial(filmed, 30_000, 3), partial(filmed, 300, 30), inspect),
        (partial(lined, False), partial(lined, True), inspect),
        (partial(lined, False), partial(lined, True), lambda flow: pose(flow, Config())),
        (partial(lined, False), partial(lined, True), normals),
    ],
    ids=["30,000 frames", "repeated points", "training on repeated points", "moved line"],
)
def test_it_takes_at_most_3_times_as_long(
    make: Callable[[], Flow], usual: Callable[[], Flow], work: Callable[[Flow], object]
) -> None:
    # The comparison holds on a machine of any speed.
    assert seconds(work, make()) < 3 * seconds(work, usual())
