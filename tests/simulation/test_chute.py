"""A chute from rest: the steady profile of Bagnold, the way to it, pressure, and its flow file.

The steady flow has a closed form. The way to it is compared with a solver of the one-dimensional
equations that shares no code with the simulator (startup.py).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import granpinn
from granpinn.commands import simulate as command
from granpinn.data.symmetry import invariant_axes, words
from granpinn.simulation import Chute, Engine
from tests.simulation import problems as p
from tests.simulation.startup import Layer, velocity

LAW = (0.4, 0.64, 0.3)
TANGENT = 0.5
SLOPE = math.degrees(math.atan(TANGENT))


def chute(d: float, cells: int, **settings: object) -> Chute:
    """A layer of depth 1 under g = 1, on a slope between the angles of mu_s and mu_2."""
    values = {"slope": SLOPE, "height": 1.0, "d": d, "cells": cells, "threads": 1, **settings}
    return Chute(*LAW, **values)  # type: ignore[arg-type]


def rows(cells: int) -> p.Array:
    """The middles of the rows of the layer."""
    return (np.arange(cells) + 0.5) / cells


def off(found: p.Array, exact: p.Array) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def run_until(engine: Engine, time: float) -> None:
    while time - engine.time > 1e-9 * time:
        engine.step(time - engine.time)


def test_layer_gets_the_profile_of_bagnold_from_rest() -> None:
    """After the slowest part has decayed: of second order in the cells, 1e-3 at 32."""
    d, errors = 0.2, []
    layer = Layer(*LAW, d, TANGENT)
    for cells in (8, 16, 32):
        # The steady flow does not depend on the steps that lead to it.
        engine = Engine(chute(d, cells), largest_step=0.1)
        run_until(engine, 120.0)
        state, y = engine.state(), rows(cells)
        errors.append(off(state.u[:cells].mean(axis=1), layer.steady(y)))
        weight = layer.pressure(y)
        assert np.abs(state.p[:cells] - weight[:, None]).max() < 2e-4  # the air weighs 1e-4
        np.testing.assert_array_equal(state.c[:cells], 1)
    assert errors[-1] < 1e-3
    assert p.order(errors[:2]) == pytest.approx(2, abs=0.2)


def test_way_to_the_steady_flow() -> None:
    """Velocity at several times against the one-dimensional solver; steps of first order."""
    d, cells, times = 0.1, 32, (2.0, 5.0, 10.0, 20.0)
    scene = chute(d, cells).resolved()
    assert scene.eta_max is not None
    y, u = velocity(Layer(*LAW, d, TANGENT, scene.eta_max), times, rows=200)
    exact = np.stack([np.interp(rows(cells), y, row) for row in u])
    engine, errors = Engine(scene), []
    for time, expected in zip(times, exact, strict=True):
        run_until(engine, time)
        errors.append(off(engine.state().u[:cells].mean(axis=1), expected))
    assert max(errors) < 0.015
    fine = Engine(scene, largest_step=scene.largest_step / 3)
    run_until(fine, times[1])
    assert off(fine.state().u[:cells].mean(axis=1), exact[1]) < errors[1] / 2


def test_layer_on_a_gentle_slope_stays() -> None:
    """tan(slope) < mu_s: nothing but creep at the largest viscosity, and the weight as pressure."""
    scene = chute(0.1, 16, slope=math.degrees(math.atan(0.35))).resolved()
    engine = Engine(scene)
    run_until(engine, 3.0)
    state = engine.state()
    assert scene.eta_max is not None
    creep = scene.gravity[0] / (2 * scene.eta_max)  # at the surface
    assert state.u[:16].max() == pytest.approx(creep, rel=0.1)
    weight = -scene.gravity[1] * (1 - rows(16))
    assert np.abs(state.p[:16] - weight[:, None]).max() < 0.01 * weight[0]


def test_flow_file_is_that_of_a_chute(tmp_path: Path) -> None:
    path = tmp_path / "chute.h5"
    small = ["--cells", "16", "--t-end", "0.2", "--frames", "5", "--threads", "1"]
    shape = ["--slope", "24", "--g", "9.81", "--height", "0.04", "--d", "0.002"]
    assert command.main(["chute", *shape, *small, "--out", str(path)]) == 0
    flow = granpinn.read_flow(path)
    angle = math.radians(24)
    assert flow.gravity == pytest.approx((9.81 * math.sin(angle), -9.81 * math.cos(angle)))
    assert flow.attributes["period_x"] == pytest.approx(8 * 0.04 / 16)
    assert (flow.attributes["slope"], flow.attributes["layer_depth"]) == (24, 0.04)
    assert (flow.u.shape, flow.steady) == ((5, 17, 8), False)
    assert flow.material[:, :16].all()
    assert not flow.c[:, 16].any()  # a row of air
    assert words(invariant_axes(flow)) == ("the same along x: no derivative along x",)
    surface = flow.surface
    assert surface is not None
    assert surface.p is not None
    np.testing.assert_allclose(surface.y, 0.04, rtol=1e-6)
    np.testing.assert_allclose(np.unique(surface.x), flow.x)
    assert flow.p is not None
    weight = 9.81 * math.cos(angle) * (0.04 - flow.y[:16])
    below = flow.p[:, :16]
    np.testing.assert_allclose(below, np.broadcast_to(weight[:, None], below.shape), rtol=0.01)
    assert np.abs(surface.p).max() < 1e-3 * weight[0]
