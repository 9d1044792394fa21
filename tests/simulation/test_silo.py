"""A silo: its discharge, and its flow file.

The discharge through an opening of width w does not depend on the height of the filling, and goes
with w^(3/2): no other length is left where the grains are small and the walls are far (Beverloo,
Leniger and van de Velde 1961).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.commands import simulate as command
from granpinn.data import read_flow
from granpinn.data.walls import segments_of
from granpinn.simulation import Engine, Silo

LAW = (0.4, 0.64, 0.3)


def silo(**settings: object) -> Silo:
    """A silo 48 grains wide, by default filled 60 grains high."""
    values = {"width": 48.0, "height": 60.0, "outlet": 12.0, "d": 1.0, "threads": 1, **settings}
    return Silo(*LAW, **values)  # type: ignore[arg-type]


def coefficient(outlet: float, cells: int, height: float, depth: float) -> float:
    """C of a discharge C sqrt(g) w^(3/2), in the second half of the time until `depth` has left."""
    scene = silo(outlet=outlet, cells=cells, height=height).resolved()
    assert (scene.outlet, scene.width) == (outlet, 48.0)
    engine, outflow, found = Engine(scene), 0.0, []
    while outflow < depth * 48.0:
        report = engine.step(1e9)
        outflow += report.outflow
        found.append((report.time, outflow))
    time, left = np.array(found).T
    steady = left > left[-1] / 2
    return float(np.polyfit(time[steady], left[steady], 1)[0] / outlet**1.5)


def test_discharge_does_not_depend_on_the_height_of_the_filling() -> None:
    rates = [coefficient(12.0, 32, height, depth=12.0) for height in (40.0, 60.0, 90.0)]
    assert np.ptp(rates) < 0.02 * np.mean(rates)


def test_discharge_goes_with_the_power_3_2_of_the_width() -> None:
    """An opening of n cells has an error of the order 1/n, here 1/12 where the narrowest has it."""
    widths = np.array([9.0, 12.0, 18.0])  # 12, 16 and 24 cells
    found = [coefficient(w, 64, height=45.0, depth=10 + w / 2) for w in widths]
    exponent = 1.5 + np.polyfit(np.log(widths), np.log(found), 1)[0]
    assert exponent == pytest.approx(1.5, abs=1 / 12 / np.log(2))


def test_flow_file_is_that_of_a_silo(tmp_path: Path) -> None:
    path = tmp_path / "silo.h5"
    shape = ["--width", "0.04", "--height", "0.06", "--outlet", "0.012", "--d", "0.001"]
    small = ["--g", "9.81", "--cells", "32", "--t-end", "0.3", "--frames", "6", "--threads", "1"]
    assert command.main(["silo", *shape, *small, "--out", str(path)]) == 0
    flow = read_flow(path)
    h = 0.04 / 32
    assert flow.gravity == (0.0, -9.81)
    assert flow.attributes["outlet_width"] == pytest.approx(10 * h)  # an even number of cells
    assert (flow.attributes["silo_width"], flow.attributes["filling_height"]) == (0.04, 0.06)
    assert flow.x == pytest.approx(h * (np.arange(32) + 0.5))
    through = flow.v[-1, 0]
    assert np.nanmax(through[11:21]) < -0.1
    assert np.abs(through[:10]).max() < 0.3 * np.abs(through[11:21]).min()
    assert flow.surface is not None
    at = flow.surface.t == flow.t[-1]
    np.testing.assert_allclose(flow.surface.x[at], flow.x)
    filled = flow.c[-1].sum(axis=0, dtype=np.float64) * h
    np.testing.assert_allclose(flow.surface.y[at], filled, rtol=1e-6)
    assert filled.mean() < 0.055
    assert flow.walls is not None
    walls = segments_of(flow.walls)
    assert walls.sticks.all()
    left = [[(0, 0.06), (0, 0)], [(0, 0), (11 * h, 0)]]
    right = [[(21 * h, 0), (0.04, 0)], [(0.04, 0), (0.04, 0.06)]]
    np.testing.assert_allclose(walls.ends, np.array(left + right), atol=1e-12)
