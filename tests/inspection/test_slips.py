"""Slips of unit, sign and order: found in every collapse, and never in sound data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.commands import inspect, train
from granpinn.data import Flow, add_noise, write_flow
from granpinn.data import read_flow as read
from granpinn.inspection import quick
from granpinn.simulation import demo_path, simulate
from tests.flows import make_flow

Change = Callable[[Flow], Flow]


@cache
def collapse(name: str) -> Flow:
    """A sound collapse by its name."""
    if name == "heap":
        return make_flow()
    if name == "coulomb":
        settings: dict[str, Any] = {"law": "coulomb", "mu_s": 0.3, "mu_2": None}
        settings |= {"cells": 64, "height": 1.0, "aspect": 2.0, "t_end": 1.5, "stride": 2}
        return simulate(**settings, frames=60)
    return read(demo_path())


COLLAPSES = ("demo", "heap", "coulomb")


def scaled(velocity: float = 1, t: float = 1, x: float = 1, y: float = 1) -> Change:
    def change(flow: Flow) -> Flow:
        s = flow.surface
        return replace(
            flow,
            u=flow.u * np.float32(velocity),
            v=flow.v * np.float32(velocity),
            t=flow.t * t,
            x=flow.x * x,
            y=flow.y * y,
            surface=None if s is None else replace(s, t=s.t * t, x=s.x * x, y=s.y * y),
        )

    return change


def with_grains(flow: Flow) -> Flow:
    return replace(scaled(x=1e3, y=1e3)(flow), grain_diameter=flow.grain_diameter * 1e3)


SLIPS: dict[str, tuple[Change, str]] = {
    "u, v x 1000": (scaled(1e3), "units of u and v, t, or x and y"),
    "u, v / 1000": (scaled(1e-3), "units of u and v, t, or x and y"),
    "t x 1000": (scaled(t=1e3), "units of u and v, t, or x and y"),
    "t / 1000": (scaled(t=1e-3), "units of u and v, t, or x and y"),
    "x, y x 1000": (scaled(x=1e3, y=1e3), "units of u and v, t, or x and y"),
    "x, y, d x 1000": (with_grains, "units of u and v, t, or x and y"),
    "x, y / 1000": (scaled(x=1e-3, y=1e-3), "units of u and v, t, or x and y"),
    "x x 1000": (scaled(x=1e3), "units of u or x"),
    "y x 1000": (scaled(y=1e3), "units of v or y"),
    "u x 1000": (lambda f: replace(f, u=f.u * np.float32(1000)), "units of u or x"),
    "-v": (lambda f: replace(f, v=-f.v), "in y: v (or y) is upside down"),
    "-u": (lambda f: replace(f, u=-f.u), "in x: u (or x) has the wrong sign"),
    "-u, -v": (lambda f: replace(f, u=-f.u, v=-f.v), "in x and y: u and v have the wrong sign"),
    "v, u": (lambda f: replace(f, u=f.v, v=f.u), "u and v, or the axes"),
    "rows": (
        lambda f: replace(f, u=f.u[:, ::-1], v=f.v[:, ::-1], c=f.c[:, ::-1]),
        "in y: v (or y) is upside down",
    ),
}


@pytest.mark.parametrize("noise", [0, 0.02, 0.2])
@pytest.mark.parametrize("name", COLLAPSES)
def test_collapses(name: str, noise: float, seed: int) -> None:
    """Sound ones are silent, with and without a surface; every slip is impossible and named."""
    flow = add_noise(collapse(name), noise, seed)
    assert quick(flow).slips == ()
    assert quick(replace(flow, surface=None)).slips == ()
    if name == "heap" and noise > 0.1:
        return  # so few vectors do not show all slips through such noise
    for slip, (change, expected) in SLIPS.items():
        found = quick(change(flow)).slips
        assert found, slip
        assert found[0].grade == "impossible", slip
        if noise == 0:
            assert expected in found[0].sentence, slip
        assert all("\n" not in each.sentence for each in found)


def cut(flow: Flow, t: slice, y: slice, x: slice) -> Flow:
    part = {name: getattr(flow, name)[t, y, x] for name in ("u", "v", "c")}
    return replace(flow, t=flow.t[t], y=flow.y[y], x=flow.x[x], surface=None, p=None, **part)


def test_parts_of_a_flow_are_sound(demo: Flow, seed: int) -> None:
    """Windows that grains enter and leave, gaps, missing fast grains, masks in place of c."""
    draw = np.random.default_rng(seed)
    for kind in ("whole", "gaps", "fast", "mask") * 10:
        # Every part has grains in its first frame: the column stands at the left until t = 1.
        frames, rows, columns = draw.integers((0, 0, 0), (20, 10, 10))
        long, high, wide = draw.integers((5, 4, 4), (80, 98, 76))
        part = cut(
            demo,
            slice(frames, frames + long),
            slice(rows, rows + high),
            slice(columns, columns + wide),
        )
        if kind == "mask":
            part = replace(part, c=(part.c > 0.5).astype(np.float32))
        elif kind != "whole":
            speed = np.hypot(part.u, part.v)
            fast = speed > np.quantile(speed[part.valid], 0.7)
            gone = fast if kind == "fast" else draw.random(part.c.shape) < 0.5
            part = replace(part, **{n: np.where(gone, np.nan, getattr(part, n)) for n in "uv"})
        assert quick(part).slips == (), (kind, part.t[0], part.y[0], part.x[0])


def steady(u: Any, v: Any, **changes: Any) -> Flow:
    """A flow that fills the grid, with white noise."""
    t, y, x = np.linspace(0, 3, 30), np.linspace(-1, 1, 24), np.linspace(-1, 1, 30)
    shape = (t.size, y.size, x.size)
    noise = np.random.default_rng(1).normal(scale=0.05, size=(2, *shape))
    fields = [noise[i] + w(x, y[:, None]) for i, w in enumerate((u, v))]
    new = {"t": t, "y": y, "x": x, "c": np.ones(shape, np.float32), "p": None, "surface": None}
    new |= dict(zip("uv", (a.astype(np.float32) for a in fields), strict=True))
    return make_flow(**(new | changes))


STEADY = {
    "chute": (lambda x, y: 2 + y + 0 * x, lambda x, y: 0 * x * y),
    "drum": (lambda x, y: -3 * y + 0 * x, lambda x, y: 3 * x + 0 * y),
    "stagnation": (lambda x, y: 3 * x + 0 * y, lambda x, y: -3 * y + 0 * x),
    "potential vortex": (lambda x, y: 3 * y + 0 * x, lambda x, y: 3 * x + 0 * y),
    "plug": (lambda x, y: 4 + 0 * x * y, lambda x, y: -4 + 0 * x * y),
    "rest": (lambda x, y: 0 * x * y, lambda x, y: 0 * x * y),
}


@pytest.mark.parametrize("name", STEADY)
def test_steady_flows_are_sound(name: str) -> None:
    assert quick(steady(*STEADY[name])).slips == ()


def test_a_flow_through_the_grid() -> None:
    """The volume shows mirrors and stretched axes; the fall shows speeds, also with few frames."""
    flow = steady(*STEADY["stagnation"])
    (mirrored,) = quick(replace(flow, v=-flow.v)).slips
    assert "u or v (or x or y) has the wrong sign" in mirrored.sentence
    (stretched,) = quick(replace(flow, x=flow.x * 1000)).slips
    assert "v_y is 990 times -u_x" in stretched.sentence
    (fast,) = quick(cut(scaled(1e3)(flow), slice(2), slice(None), slice(None))).slips
    assert fast.grade == "impossible"
    assert "the speed of a free fall" in fast.sentence
    (jet,) = quick(scaled(100)(flow)).slips
    assert jet.grade == "improbable"  # it may come from far above the grid


def test_train_refuses_before_training(
    demo: Flow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "flow.h5"
    write_flow(replace(demo, v=-demo.v), path)
    assert train.main([str(path), "--out", str(tmp_path / "run")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"granpinn.train: {path}: the center of mass moves against")
    assert err.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_inspect_leads_with_slips(
    demo: Flow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "flow.h5"
    write_flow(scaled(1e3)(demo), path)
    assert inspect.main([str(path)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("impossible: the velocity integrated over time is 970 times the way")
    assert "next: mend the flow file, or convert again with the right calibration" in printed
    assert "Grains accelerate" not in printed
