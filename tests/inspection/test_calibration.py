"""The rules behind the slips of calibration, on flows whose numbers are known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granpinn.data import Flow, Surface
from granpinn.data.scaling import initial_height
from granpinn.inspection.body import body_of
from granpinn.inspection.fall import energy_of, fall_of, slender
from granpinn.inspection.frame_slips import missing, repeated
from granpinn.inspection.gravity_slips import gravity_slips
from granpinn.inspection.inertia import Inertia
from granpinn.inspection.size_slips import against_fall, not_dense, size_slips
from granpinn.inspection.slips import slips
from granpinn.inspection.surface_slips import line_of, surface_slips
from granpinn.inspection.wording import about, digits
from tests.flows import make_chute, make_flow
from tests.inspection.falling import WIDTH, G, H, falling


def words(flow: Flow, closed: bool = True) -> list[str]:
    return [str(slip) for slip in gravity_slips(flow, body_of(flow), H, closed)]


@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize(("acceleration", "degrees"), [(1.0, 0.0), (2.0, 4.0), (0.3, -6.0)])
def test_the_fall_is_measured(acceleration: float, degrees: float, noise: float, seed: int) -> None:
    """Within four standard errors, also with noise of a tenth to a third of the largest speed."""
    flow = falling(acceleration, degrees, noise, seed)
    fall = fall_of(flow, body_of(flow))
    assert fall is not None
    assert fall.side == "top"
    assert fall.error < 0.05
    assert abs(fall.size - acceleration) < 4 * fall.error + 1e-6
    assert (
        abs(fall.tilt(flow.gravity) - degrees) < 4 * math.degrees(fall.error / acceleration) + 1e-3
    )


def test_bounds_of_the_fall() -> None:
    assert words(falling()) == []
    assert words(falling(1.05)) == []
    assert words(falling(1.5))[0].startswith("improbable: the top of the grains falls with 1.5")
    assert words(falling(2.0))[0].startswith("impossible: the top of the grains falls with 2 ")
    assert words(falling(degrees=2.5)) == []
    assert "accelerates 3.5 degrees counter-clockwise of gravity" in words(falling(degrees=3.5))[0]
    assert "accelerates 3.5 degrees clockwise of gravity" in words(falling(degrees=-3.5))[0]
    assert words(falling(2.0), closed=False) == []
    still = falling(0.0, noise=0.01)
    assert words(still) == []


@pytest.mark.parametrize(
    ("gravity", "picture"), [((0.0, G), "upside down"), ((G, 0.0), "turned by a quarter")]
)
def test_the_direction_of_the_fall(gravity: tuple[float, float], picture: str) -> None:
    (found,) = words(replace(falling(), gravity=gravity))
    assert found.startswith("impossible: the top of the grains falls with 1 times gravity")
    assert picture in found


def test_a_slender_column_falls_freely() -> None:
    """The block ends where it started, lower; what falls as slowly is no column if it is wide."""
    slow = falling(0.2)
    column = replace(slow, c=np.where(slow.y[:, None] < 0.2 + slow.t[-1], slow.c, slow.c))
    body = body_of(column)
    aspect, heights = slender(body, column.gravity)
    assert aspect == pytest.approx(H / WIDTH, rel=0.15)
    assert heights[0] == 1
    shrunk = replace(body, extent=body.extent * np.linspace(1, 0.5, 21)[:, None])
    (found,) = gravity_slips(column, shrunk, H, closed=True)
    assert "falls with 0.2 times the gravity of the file" in found.text
    wide = replace(shrunk, extent=shrunk.extent * [6, 1])
    assert gravity_slips(column, wide, H, closed=True) == []


def test_energy_is_that_of_the_fall() -> None:
    """A free fall turns all of the work into kinetic energy; less gravity in the file, more."""
    flow = falling()
    energy = energy_of(flow, body_of(flow), H)
    assert energy is not None
    assert energy.share == pytest.approx(1, rel=1e-3)
    assert energy.work == pytest.approx(flow.t[-1] ** 2 * G / 2, rel=1e-3)
    assert energy_of(falling(0.0, noise=0.1), body_of(falling(0.0, noise=0.1)), H) is None


def test_energy_of_a_layer_from_rest() -> None:
    """Its acceleration along the slope is less than that part of gravity."""
    chute = make_chute(frames=12)
    attributes = {"period_x": chute.attributes["period_x"]}
    g_x = chute.gravity[0]
    speed = np.where(np.isfinite(chute.u), 1.0, np.nan)

    def speeds_up(part: float) -> list[str]:
        u = speed * part * g_x * (chute.t - chute.t[0])[:, None, None]
        return words(replace(chute, u=u, attributes=attributes), closed=False)

    assert speeds_up(0.9) == []
    assert speeds_up(1.3)[0].startswith("improbable: the grains gain 1.3 times the energy")
    assert speeds_up(2.0)[0].startswith("impossible: the grains gain 2 times the energy")
    assert speeds_up(-0.5)[0].startswith("improbable: the grains gain speed while they rise")


def test_surface_line() -> None:
    """Heights of a chute, whose line lies at the top of its grains."""
    chute = make_chute()
    line = chute.surface
    assert line is not None
    assert surface_slips(chute) == []

    def at(height: float) -> list[str]:
        moved = Surface(line.t, line.x, np.full_like(line.y, height))
        return [str(slip) for slip in surface_slips(replace(chute, surface=moved))]

    assert at(13.5) == []
    assert "cells above the uppermost vectors" in at(17.0)[0]
    assert at(5.0)[0].startswith("improbable: 33% of the vectors lie more than 3 cells above")
    assert at(0.0)[0].startswith("impossible: 75% of the vectors lie more than 3 cells above")
    assert "run uphill (0.37" in surface_slips(replace(chute, u=-chute.u))[0].text


def with_line(flow: Flow, late: float, offset: float = 0.0) -> Flow:
    """The block with a line at its top, which is late by a time and too high."""
    t, x = (a.ravel() for a in np.meshgrid(flow.t, flow.x[2:10], indexing="ij"))
    y = 0.5 + H - G * np.maximum(t - late, 0) ** 2 / 2 + offset
    return replace(flow, surface=Surface(t, x, y))


@pytest.mark.parametrize("frames_late", [-3.0, 3.0, 4.0])
@pytest.mark.parametrize("offset", [0.0, 0.025])  # a cell
def test_a_line_that_is_late(frames_late: float, offset: float) -> None:
    flow = with_line(falling(noise=0.2), 0.01 * frames_late, offset)
    line = line_of(flow)
    assert line is not None
    assert line.late == pytest.approx(frames_late, abs=0.6)
    side = "behind" if frames_late > 0 else "ahead of"
    (found,) = surface_slips(flow)
    assert found.severity == "improbable"
    assert f"frames {side} the motion of the grains at the surface" in found.text


@pytest.mark.parametrize(("frames_late", "offset"), [(0.0, 0.0), (0.0, 0.05), (1.0, 0.0)])
def test_a_line_that_may_be_in_time(frames_late: float, offset: float) -> None:
    flow = with_line(falling(noise=0.2), 0.01 * frames_late, offset)
    line = line_of(flow)
    assert line is not None
    assert line.lag is not None
    assert line.lag.time == pytest.approx(0.01 * frames_late, abs=0.005)
    assert line.late is None
    assert surface_slips(flow) == []


def frames(flow: Flow, kept: list[int]) -> Flow:
    """Some frames of a flow, numbered on."""
    t = np.arange(len(kept)) * (flow.t[1] - flow.t[0])
    return replace(flow, t=t, **{name: getattr(flow, name)[kept] for name in ("u", "v", "c")})


def test_repeated_and_missing_frames() -> None:
    flow = falling()
    assert repeated(flow) == missing(flow, body_of(flow)) == []
    assert repeated(frames(flow, [0, *range(21)])) == []  # all grains are at rest in both
    assert repeated(frames(flow, [*range(10), *range(9, 21)])) == []
    (found,) = repeated(frames(flow, [0, *range(21), 20, 20, 20, 20]))
    assert found.text.startswith("4 of 26 frames repeat the one before (first: frame 23, t = 0.22)")
    fewer = frames(flow, [*range(10), *range(18, 21)])
    (found,) = missing(fewer, body_of(fewer))
    assert found.text.startswith("between frames 10 and 11 (t = 0.09) the center of mass moves")


def test_a_level_top_that_sinks_below_a_row_is_no_slip() -> None:
    """On a grid of which every other row counts: the center of mass falls by half of two rows."""
    x, y, t = np.arange(150) + 0.5, np.arange(160) + 0.5, np.arange(12.0)
    top = 119.6 - 0.1 * t[:, None, None]
    c = np.broadcast_to(y[:, None] + 0.5 <= top, (12, 160, 150)).astype(np.float32)
    flow = make_flow(t=t, y=y, x=x, c=c, p=None, surface=None)
    v = np.where(c == 1, -0.1 * y[:, None] / top, np.nan).astype(np.float32)
    flow = replace(flow, u=0 * v, v=v)
    body = body_of(flow)
    assert body.spacing == 2
    assert np.diff(body.place[:, 1]).min() == pytest.approx(-1)
    assert missing(flow, body) == []


def test_grains_that_leave_the_view_are_no_slip() -> None:
    """A few vectors on a fine grid, in the first frame alone."""
    axis, c = np.linspace(0, 1, 400), np.zeros((3, 400, 400), np.float32)
    c[0, 101:105, 101:104] = 1
    flow = make_flow(t=np.arange(3.0), y=axis, x=axis, c=c, p=None, surface=None)
    u = np.where(c == 1, np.linspace(0.1, 0.2, 400, dtype=np.float32), np.float32(np.nan))
    flow = replace(flow, u=u, v=u, grain_diameter=1e-4)
    assert body_of(flow).t.tolist() == [0.0]
    assert slips(flow) == []


@pytest.mark.parametrize(
    ("change", "text", "severity"),
    [
        ({"grain_diameter": 0.2}, "grains are 4.8 diameters high", "unusual"),
        ({"grain_diameter": 1e-4}, "grains are 9,600 diameters high", "unusual"),
        ({"grain_density": 15_000.0}, "the grains fill 0.1 of the space", "improbable"),
        ({"gravity": (0.0, -9810.0)}, "gravity is 9,800 m/s^2", "unusual"),
    ],
)
def test_sizes(change: dict[str, Any], text: str, severity: str) -> None:
    assert size_slips(make_flow()) == []
    (found,) = size_slips(make_flow(**change))
    assert found.severity == severity
    assert text in found.text


def test_sizes_of_flows_of_few_grains() -> None:
    assert size_slips(make_flow(grain_diameter=0.7))[0].severity == "impossible"
    assert size_slips(make_flow(length_unit="1", gravity=(0.0, -1e4))) == []


def test_a_wrong_scale_is_named_before_a_tilt() -> None:
    """A scale that is 9 % too large makes the fall faster; a tilt does not."""
    (both,) = words(falling(1.09, 4.0))
    assert both.index("the scale is about 9% too large") < both.index("--tilt")
    (turned,) = words(falling(1.0, 4.0))
    assert "scale" not in turned


def test_speeds_and_inertial_numbers() -> None:
    flow, fall = make_flow(), math.sqrt(2 * G)
    for factor, severity in ((1.4, None), (1.6, "improbable"), (6.0, "impossible")):
        found = against_fall(flow, np.full(9, factor * fall), 1.0, closed=True)
        assert [slip.severity for slip in found] == ([] if severity is None else [severity])
    assert against_fall(flow, np.full(9, 6.0 * fall), 1.0, closed=False) == []
    assert against_fall(flow, np.array([]), 1.0, closed=True) == []
    flow = make_flow()
    dense, gas = (Inertia(0.01, q50, 2.0, 3.0, None, None) for q50 in (0.5, 3.0))
    assert not_dense(flow, None) == not_dense(flow, dense) == []
    assert "the inertial number is 3 (median)" in not_dense(flow, gas)[0].text
    few = replace(flow, grain_diameter=initial_height(flow) / 6)
    (slip,) = not_dense(few, dense)
    assert slip.severity == "improbable"
    assert "6 diameters high, and the inertial number reaches 3" in slip.text


def test_factors_in_words() -> None:
    assert [about(f) for f in (982.0, 1 / 50, 2e7)] == ["980 times", "1/50 of", "2.0e+07 times"]
    assert [digits(f) for f in (0.123, 4012.0)] == ["0.12", "4,000"]
