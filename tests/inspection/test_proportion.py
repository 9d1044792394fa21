"""Time in proportion: many small frames and repeated points cost no more than others."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data import Flow, Surface
from granpinn.data.surface import outward_normals
from granpinn.fit.case import pose
from granpinn.inspection import inspect
from tests.flows import make_flow


def many_frames() -> Flow:
    """30,000 frames of 3 x 3 vectors."""
    t, side = np.linspace(0, 10, 30_000), np.array([0.1, 0.2, 0.3])
    T, Y, _ = np.meshgrid(t, side, side, indexing="ij")
    noise = 0.01 * np.random.default_rng(0).normal(size=(2, *T.shape))
    u, v = np.float32(np.sin(T) * Y + noise[0]), np.float32(noise[1])
    line = Surface(np.repeat(t, 3), np.tile(side, len(t)), np.full(3 * len(t), 0.32))
    made = make_flow(t=t, x=side, y=side, u=u, v=v, c=np.ones_like(u), p=None, surface=line)
    return replace(made, grain_diameter=0.01)


def repeated(count: int = 300_000) -> Flow:
    """A surface line of which nearly all points repeat four of them."""
    flow = make_flow(frames=8, rows=27, columns=23)
    line = flow.surface
    assert line is not None
    some = np.random.default_rng(0).integers(0, 4, count - line.t.size)
    k = np.concatenate([np.arange(line.t.size), some])
    return replace(flow, surface=Surface(line.t[k], line.x[k], line.y[k]))


def normals(flow: Flow) -> object:
    assert flow.surface is not None
    return outward_normals(flow, flow.surface)


@pytest.mark.parametrize(
    ("make", "work"),
    [
        (many_frames, inspect),
        (repeated, inspect),
        (repeated, lambda flow: pose(flow, Config())),
        (repeated, normals),
    ],
    ids=["30,000 frames", "repeated points", "training on repeated points", "moved line"],
)
def test_it_takes_at_most_3_s(make: Callable[[], Flow], work: Callable[[Flow], object]) -> None:
    flow = make()
    begin = time.process_time()
    work(flow)
    assert time.process_time() - begin < 3
