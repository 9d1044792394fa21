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
from granpinn.inspection import Inspection, quick
from granpinn.inspection.gravity import energy_of, fall_of, slender
from granpinn.inspection.inertial_number import InertialRange
from granpinn.results.record import FLOW, SLIPS, Reason, every
from tests.flows import make_chute, make_flow
from tests.inspection.falling import WIDTH, G, H, falling


def slips(name: str, flow: Flow, closed: bool | None = None, **changes: Any) -> list[Reason]:
    """The slips that one check finds, with changes of its record, in a flow that is closed or not.

    Args:
        closed: None: as the flow is.
    """
    found = quick(flow)
    assert not found.not_done
    if closed is not None:
        found.records["mass"] = replace(found["mass"], closed=closed)
    reasons = replace(found[name], **changes).reasons(found)
    return [reason for reason in reasons if reason.grade in SLIPS]


def words(flow: Flow, closed: bool | None = None, **changes: Any) -> list[str]:
    return [str(slip) for slip in slips("gravity", flow, closed, **changes)]


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
    assert abs(fall.tilt - degrees) < 4 * math.degrees(fall.error / acceleration) + 1e-3


def test_a_slender_column_falls_freely() -> None:
    """The block keeps its height, as no column does; what falls as slowly is none if it is wide."""
    flow = falling(0.2)
    aspect, shrinks = slender(body_of(flow))
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


def test_speeds() -> None:
    flow, alone = make_flow(), {"energy": None, "fall": None}
    for factor, severity in ((1.4, None), (1.6, "improbable"), (6.0, "impossible")):
        found = slips("gravity", flow, True, speed=factor, **alone)
        assert [slip.grade for slip in found] == ([] if severity is None else [severity])
    assert slips("gravity", flow, False, speed=6.0, **alone) == []
    fast = np.full(9, 3.0 * math.sqrt(2 * G * quick(flow).height))
    inspection = quick(flow)
    inspection.speeds = fast
    (check,) = (check for check in every(FLOW) if check.name == "gravity")
    inspection.take(check)
    assert inspection["gravity"].speed == pytest.approx(3.0)


def test_inertial_numbers_of_a_gas() -> None:
    flow = make_flow()

    def slips_of(median: float, flow: Flow = flow) -> list[Reason]:
        numbers = InertialRange(0.0, median, 1.0, 3.0, None, 0.0, 1.0, ())
        return numbers.reasons(Inspection(flow))

    assert slips_of(0.5) == []
    assert "the inertial number is 3 (median)" in slips_of(3.0)[0].sentence
    few = replace(flow, grain_diameter=initial_height(flow) / 6)
    (slip,) = slips_of(0.5, few)
    assert slip.grade == "improbable"
    assert "6 diameters high, and the inertial number reaches 3" in slip.sentence
