"""The rules behind the slips of calibration, on flows whose numbers are known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granpinn.data import Flow, Surface
from granpinn.data.scaling import initial_height
from granpinn.estimates.body import body_of
from granpinn.inspection import Inspection, about, digits, quick
from granpinn.inspection.gravity import energy_of, fall_of, slender
from granpinn.inspection.inertial_number import InertialRange
from granpinn.inspection.mass import jump_of
from granpinn.results.record import FLOW, SLIPS, Reason, every
from tests.flows import make_chute, make_flow
from tests.inspection.falling import WIDTH, G, H, falling


def slips(name: str, flow: Flow, **changes: Any) -> list[Reason]:
    """The slips that one check finds, with changes of its record."""
    found = quick(flow)
    assert not found.not_done
    reasons = replace(found[name], **changes).reasons(found)
    return [reason for reason in reasons if reason.grade in SLIPS]


def words(flow: Flow, **changes: Any) -> list[str]:
    return [str(slip) for slip in slips("gravity", flow, **changes)]


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
    assert words(falling(2.0), closed=False, energy=None) == []
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
    """The block keeps its height, as no column does; what falls as slowly is none if it is wide."""
    flow = falling(0.2)
    aspect, shrinks = slender(body_of(flow), flow.gravity)
    assert aspect == pytest.approx(H / WIDTH, rel=0.15)
    assert shrinks == pytest.approx(1, abs=0.1)
    assert words(flow) == []
    (found,) = words(flow, shrinks=0.5, closed=True)
    assert "falls with 0.2 times the gravity of the file" in found
    assert words(flow, shrinks=0.5, aspect=1.0, closed=True) == []


def test_energy_is_that_of_the_fall() -> None:
    """A free fall turns all of the work into kinetic energy; less gravity in the file, more."""
    flow = falling()
    energy = energy_of(flow, body_of(flow), H)
    assert energy is not None
    gained, work = energy
    assert gained == pytest.approx(work, rel=1e-3)
    assert work == pytest.approx(flow.t[-1] ** 2 * G / 2, rel=1e-3)
    assert energy_of(falling(0.0, noise=0.1), body_of(falling(0.0, noise=0.1)), H) is None


def test_energy_of_a_layer_from_rest() -> None:
    """Its acceleration along the slope is less than that part of gravity."""
    chute = make_chute(frames=12)
    attributes = {"period_x": chute.attributes["period_x"]}
    g_x = chute.gravity[0]
    speed = np.where(np.isfinite(chute.u), 1.0, np.nan)

    def speeds_up(part: float) -> list[str]:
        u = speed * part * g_x * (chute.t - chute.t[0])[:, None, None]
        return words(replace(chute, u=u, attributes=attributes), speed=1.0)

    assert speeds_up(0.9) == []
    assert speeds_up(1.3)[0].startswith("improbable: the grains gain 1.3 times the energy")
    assert speeds_up(2.0)[0].startswith("impossible: the grains gain 2 times the energy")
    assert speeds_up(-0.5)[0].startswith("improbable: the grains gain speed while they rise")


def test_surface_line() -> None:
    """Heights of a chute, whose line lies at the top of its grains."""
    chute = make_chute()
    line = chute.surface
    assert line is not None

    def at(height: float, u: float = 1.0) -> list[str]:
        moved = Surface(line.t, line.x, np.full_like(line.y, height))
        flow = replace(chute, surface=moved, u=u * chute.u)
        return [str(slip) for slip in slips("surface", flow)]

    assert at(12.0) == at(13.5) == []
    assert "cells above the uppermost vectors" in at(17.0)[0]
    assert at(5.0)[0].startswith("improbable: 33% of the vectors lie more than 3 cells above")
    assert at(0.0)[0].startswith("impossible: 75% of the vectors lie more than 3 cells above")
    assert "run uphill (0.37" in at(12.0, -1.0)[0]


def frames(flow: Flow, kept: list[int]) -> Flow:
    """Some frames of a flow, numbered on."""
    t = np.arange(len(kept)) * (flow.t[1] - flow.t[0])
    return replace(flow, t=t, **{name: getattr(flow, name)[kept] for name in ("u", "v", "c")})


def test_repeated_frames() -> None:
    flow = falling()
    assert slips("frames", flow) == []
    assert slips("frames", frames(flow, [0, *range(21)])) == []  # all grains are at rest in both
    one = quick(frames(flow, [*range(10), *range(9, 21)]))
    assert one["frames"].repeated == (10,)
    assert one.slips == ()
    (found,) = slips("frames", frames(flow, [0, *range(21), 20, 20, 20, 20]))
    text = "4 of 26 frames repeat the one before (first: frame 23, t = 0.22)"
    assert found.sentence.startswith(text)


def test_missing_frames() -> None:
    assert slips("mass", falling()) == []
    (found,) = slips("mass", frames(falling(), [*range(10), *range(18, 21)]))
    text = "between frames 10 and 11 (t = 0.09) the center of mass moves"
    assert found.sentence.startswith(text)


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
    assert jump_of(flow, body) is None


def test_grains_that_leave_the_view_are_no_slip() -> None:
    """A few vectors on a fine grid, in the first frame alone."""
    axis, c = np.linspace(0, 1, 400), np.zeros((3, 400, 400), np.float32)
    c[0, 101:105, 101:104] = 1
    flow = make_flow(t=np.arange(3.0), y=axis, x=axis, c=c, p=None, surface=None)
    u = np.where(c == 1, np.linspace(0.1, 0.2, 400, dtype=np.float32), np.float32(np.nan))
    flow = replace(flow, u=u, v=u, grain_diameter=1e-4)
    assert body_of(flow).t.tolist() == [0.0]
    assert quick(flow).slips == ()


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
    assert slips("statements", make_flow()) == []
    (found,) = slips("statements", make_flow(**change))
    assert found.grade == severity
    assert text in found.sentence


def test_sizes_of_flows_of_few_grains() -> None:
    assert slips("statements", make_flow(grain_diameter=0.7))[0].grade == "impossible"
    assert slips("statements", make_flow(length_unit="1", gravity=(0.0, -1e4))) == []


def test_a_wrong_scale_is_named_before_a_tilt() -> None:
    """A scale that is 9 % too large makes the fall faster; a tilt does not."""
    (both,) = words(falling(1.09, 4.0))
    assert both.index("the scale is about 9% too large") < both.index("--tilt")
    (turned,) = words(falling(1.0, 4.0))
    assert "scale" not in turned


def test_speeds() -> None:
    record = quick(make_flow())["gravity"]
    for factor, severity in ((1.4, None), (1.6, "improbable"), (6.0, "impossible")):
        found = replace(record, speed=factor, energy=None, fall=None, closed=True).reasons(None)
        assert [slip.grade for slip in found] == ([] if severity is None else [severity])
    assert replace(record, speed=6.0, energy=None, fall=None, closed=False).reasons(None) == []
    flow = make_flow()
    fast = np.full(9, 3.0 * math.sqrt(2 * G * quick(flow).height))
    inspection = quick(flow)
    inspection.speeds = fast
    (check,) = (check for check in every(FLOW) if check.name == "gravity")
    inspection.take(check)
    assert inspection["gravity"].speed == pytest.approx(3.0)


def test_inertial_numbers_of_a_gas() -> None:
    flow = make_flow()

    def slips_of(median: float, flow: Flow = flow) -> list[Reason]:
        numbers = InertialRange(0.0, median, 1.0, 3.0, None, None, 0.0, 1.0, 0.5, ())
        return numbers.reasons(Inspection(flow))

    assert slips_of(0.5) == []
    assert "the inertial number is 3 (median)" in slips_of(3.0)[0].sentence
    few = replace(flow, grain_diameter=initial_height(flow) / 6)
    (slip,) = slips_of(0.5, few)
    assert slip.grade == "improbable"
    assert "6 diameters high, and the inertial number reaches 3" in slip.sentence


def test_factors_in_words() -> None:
    assert [about(f) for f in (982.0, 1 / 50, 2e7)] == ["980 times", "1/50 of", "2.0e+07 times"]
    assert [digits(f) for f in (0.123, 4012.0)] == ["0.12", "4,000"]
