"""How well the surface line is known, and the line moved along its normal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granpinn.data import Flow, read_flow, write_flow
from granpinn.data.surface import distance_to_fraction, moved, surface_sd
from tests.flows import make_flow, scattered

FINE = {"frames": 4, "rows": 66, "columns": 120}


def masked(flow: Flow) -> Flow:
    return replace(flow, c=(flow.c > 0.5).astype(np.float32))


def solver(flow: Flow) -> Flow:
    return replace(flow, attributes={"grid_spacing_of_solver": flow.spacing[1]})


@pytest.mark.parametrize("turn", [0.0, 2.0, 4.0])
def test_a_line_of_any_direction_moves_away_from_the_grains(turn: float) -> None:
    """A disk of grains, whose outline folds: every point ends on the circle of another radius."""
    angle = np.linspace(turn, turn + 5, 60)
    flow = make_flow(frames=2, rows=48, columns=80)
    distance = np.hypot(flow.x - 1.0, flow.y[:, None] - 0.55)
    c = np.broadcast_to((distance < 0.4).astype(np.float32), flow.c.shape)
    velocity = np.where(c == 1, np.float32(0.1), np.float32(np.nan))
    assert flow.surface is not None
    x, y = 1 + 0.4 * np.cos(angle), 0.55 + 0.4 * np.sin(angle)
    line = replace(flow.surface, t=np.full(60, flow.t[1]), x=x, y=y, p=None)
    there = with_moved_surface(replace(flow, c=c, u=velocity, v=velocity, surface=line), 0.05)
    assert there.surface is not None
    radius = np.hypot(there.surface.x - 1.0, there.surface.y - 0.55)
    # The ends of the line have neighbors on one side alone.
    np.testing.assert_allclose(radius[3:-3], 0.45, atol=1e-3)


@pytest.mark.parametrize("offset", [-1.0, -0.5, 0.5, 1.0])
def test_the_fraction_shows_where_the_line_should_be(offset: float) -> None:
    """c falls through 1/2 on the line of `make_flow`, to a fraction of a cell."""
    flow = make_flow(**FINE)
    there = with_moved_surface(flow, offset * flow.spacing[1])
    assert flow.surface is not None
    assert there.surface is not None
    assert distance_to_fraction(flow, flow.surface) < 0.1 * flow.spacing[1]
    found = distance_to_fraction(there, there.surface)
    assert found == pytest.approx(abs(offset) * flow.spacing[1], rel=0.2)


def test_the_rule() -> None:
    flow = make_flow(**FINE)
    h, d = flow.spacing[1], flow.grain_diameter
    assert h / 2 < d / 2
    assert surface_sd(flow, "V1") == d / 2  # the line and c agree better than that
    small = replace(flow, grain_diameter=h / 10)
    assert surface_sd(masked(small), "V1") == h / 2
    assert surface_sd(small, "V1") < h / 10
    shifted = with_moved_surface(small, h)
    assert surface_sd(shifted, "V1") == pytest.approx(h, rel=0.2)
    assert surface_sd(small, "V0") == h / 2
    assert surface_sd(replace(small, surface=None), "V0") == h / 2
    assert surface_sd(scattered(make_flow()), "V1") == 0.025 / 2


@pytest.mark.parametrize("stated", [0.0, 0.003])
def test_the_file_decides(tmp_path: Path, stated: float) -> None:
    for k, flow in enumerate((make_flow(), masked(make_flow()), solver(make_flow()))):
        with_sd = replace(flow, attributes={**flow.attributes, "surface_sd": stated})
        write_flow(with_sd, tmp_path / f"{k}.h5")
        assert surface_sd(read_flow(tmp_path / f"{k}.h5"), "V1") == stated
        assert surface_sd(with_sd, "V0") == surface_sd(flow, "V0")


def with_moved_surface(flow: Flow, offset: float) -> Flow:
    assert flow.surface is not None
    return replace(flow, surface=moved(flow, flow.surface, offset)[0])
