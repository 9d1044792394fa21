"""What walls leave open: grains that hang between them, and flows without a free surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.config import Config, Network
from granpinn.data import Flow, Walls
from granpinn.estimates.confined import NO_PRESSURE, NO_WORK_WORDS, undetermined
from granpinn.identification.identify import identify
from granpinn.inspection import inspect
from granpinn.inspection.momentum_balance import baseline
from granpinn.results import read_results
from tests.data.walled import line, single
from tests.flows import make_chute
from tests.inspection.chutes import chute

TINY = Config(level="V0", steps=2, device="cpu", network=Network(widths=(8,)))


def plane_shear(**changes: Any) -> Flow:
    """A layer between y = 0 and a plate at y = 12, which moves along x; periodic along x."""
    x, y = np.arange(16) + 0.5, np.arange(12) + 0.5
    u = np.broadcast_to(np.exp((y[:, None] - 12) / 3), (1, 12, 16))
    plate = line((0, 0), (16, 0), (np.nan, np.nan), (0, 12), (16, 12), p=single(*[np.nan] * 5))
    flow = Flow(
        t=np.zeros(1), y=y, x=x, u=u.copy(), v=np.zeros_like(u), c=np.ones(u.shape, np.float32),
        gravity=(0.0, -1.0), density=1.0, grain_diameter=0.5, walls=plate,
        attributes={"period_x": 16.0},
    )  # fmt: skip
    return replace(flow, **changes)


LOADED = line((0, 12), (16, 12), p=single(20, 20))


def test_a_slope_needs_one_known_pressure() -> None:
    """Gravity along x drives the grains: the load of the plate is all that is missing."""
    slope = plane_shear(gravity=(0.4, -0.9))
    assert undetermined(slope, "V0") == NO_PRESSURE
    assert undetermined(replace(slope, walls=None), "V0") == NO_PRESSURE
    assert undetermined(replace(slope, walls=LOADED), "V0") is None


def test_a_free_surface_fixes_the_pressure() -> None:
    """The line at level V1; at V0 the upper edge of the grains, which a plate is not."""
    flow = make_chute()
    assert undetermined(flow, "V1") is None
    assert undetermined(replace(flow, surface=None), "V0") is None
    top = float(flow.y[np.flatnonzero(flow.material[0].all(axis=1))[-1]])
    lid = line((0, top + 0.6), (32, top + 0.6))
    assert undetermined(replace(flow, walls=lid), "V0") == NO_PRESSURE
    assert undetermined(replace(flow, walls=lid), "V1") is None


def test_inspect_says_so_first() -> None:
    found = inspect(plane_shear())
    sentences = found.sentences
    assert sentences[0].startswith("No friction coefficient can be given: the flow has no free")
    assert found["precision"].expected is None
    assert found.numbers()["friction_refused_because"] == NO_WORK_WORDS
    printed = found.lines()
    assert any(row.startswith("walls   ") and "(0, 0) to (16, 0)" in row for row in printed)
    assert any("(0, 12) to (16, 12)" in row for row in printed)
    assert len(found["walls"].walls) == 2


def test_results_have_no_friction(tmp_path: Path) -> None:
    result = identify(plane_shear(), TINY, run_dir=tmp_path / "run")
    assert [name for name, p in result.parameters.items() if not p.determined] == ["mu_s", "mu_2"]
    assert f"mu_s and mu_2 not determined: {NO_WORK_WORDS}" in result.summary()
    again = read_results(tmp_path / "run" / "results.json")
    assert again.no_law == result.no_law == NO_WORK_WORDS


def silo(distance: float) -> Flow:
    """The layer of 8 grain diameters, with walls on both sides."""
    flow = chute(columns=30)
    middle = float(flow.x.mean())
    sides = [(middle - distance / 2, 12), (middle - distance / 2, -1), (np.nan, np.nan),
             (middle + distance / 2, 12), (middle + distance / 2, -1)]  # fmt: skip
    return replace(flow, walls=line(*sides))


def test_grains_that_hang_between_walls() -> None:
    """The weight on walls is more than a third if the depth exceeds the distance by a fifth."""
    found = baseline(silo(6.0))
    assert found.carried
    assert found.reason is not None
    assert "hang between the wall from (12, 12) to (12, -1) and the wall from (18, 12)" in (
        found.reason
    )
    for distance in (12.0, 40.0):
        assert baseline(silo(distance)).reason is None
    one = silo(6.0)
    assert one.walls is not None
    half = Walls(one.walls.x[:2], one.walls.y[:2])
    assert baseline(replace(one, walls=half)).reason is None
