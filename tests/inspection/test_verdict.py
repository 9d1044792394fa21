"""What an inspection says of good data, and of data with defects."""

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, add_noise
from granpinn.inspection import MOST_LINES, Inspection, inspect
from tests.inspection.chutes import chute

pytestmark = pytest.mark.usefixtures("no_balance")


def said(found: Inspection) -> str:
    assert len(found.lines()) <= MOST_LINES
    assert not found.not_done
    return " ".join(found.sentences)


def test_good_data(inspected: Inspection) -> None:
    found = inspected
    text = said(found)
    assert "Expected of a training at level V1: mu_s to" in text
    assert found["gravity"].fall.size == pytest.approx(1, abs=0.05)
    assert found["gravity"].fall.tilt == pytest.approx(0, abs=2)
    assert found["vectors"].invalid_share == 0
    assert 0.05 < found["inertial_number"].q95 < 0.2
    assert found["shear"].divergence < 0.05


def test_frames_without_vectors_and_repeated_frames(demo: Flow) -> None:
    u, v = demo.u.copy(), demo.v.copy()
    u[30:33] = v[30:33] = np.nan
    u[50], v[50] = u[49], v[49]
    found = inspect(
        replace(
            demo,
            u=u,
            v=v,
            c=np.where(np.arange(100)[:, None, None] == 50, demo.c[49], demo.c).astype(np.float32),
        )
    )
    frames = found["frames"]
    assert frames.poor == (30, 31, 32)
    assert frames.repeated == (50,)
    assert "3 frames lack vectors" in said(found)
    assert "1 frames repeat" in said(found)
    assert found["precision"].expected is not None


def test_an_inertial_number_that_stays_small(demo: Flow, inspected: Inspection) -> None:
    """Grains ten times smaller: the same motion at a tenth of I."""
    found = inspect(replace(demo, grain_diameter=demo.grain_diameter / 10))
    assert "mu_2 not determined: the grains shear at I = " in said(found)
    small, large = (i["inertial_number"].q50 for i in (found, inspected))
    assert small == pytest.approx(large / 10, rel=0.1)


def test_grains_that_leave_the_plane(demo: Flow) -> None:
    """In stripes: not free of divergence, and no factor between x and y."""
    out = 1 + 0.2 * np.sin(6 * demo.x / 12.8e-3)
    found = inspect(replace(demo, u=(out * demo.u).astype(np.float32)))
    assert "div v is" in said(found)
    assert "PIV of an incompressible flow left 8%" in said(found)


def test_units_do_not_matter(demo: Flow, seed: int) -> None:
    """The same collapse in other units of length, time and density."""
    flow = add_noise(demo, 0.02, seed)
    assert demo.surface is not None
    length, time = 0.02, 0.1
    speed = np.float32(length / time)
    physical = replace(
        flow,
        t=time * flow.t,
        x=length * flow.x,
        y=length * flow.y,
        u=speed * flow.u,
        v=speed * flow.v,
        gravity=(0.0, flow.gravity[1] * length / time**2),
        grain_diameter=length * flow.grain_diameter,
        density=1550.0,
        sigma_u=None,
        sigma_v=None,
        surface=None,
        p=None,
        length_unit="m",
        time_unit="s",
    )
    plain, found = inspect(replace(flow, surface=None)), inspect(physical)
    assert found["noise"].relative == pytest.approx(plain["noise"].relative, rel=1e-3)
    for numbers in (
        lambda part: [part["shear"].flowing, part["shear"].divergence],
        lambda part: [part["inertial_number"].q05, part["inertial_number"].q99],
        lambda part: [*part["precision"].expected.values()],
    ):
        assert numbers(found) == pytest.approx(numbers(plain), rel=1e-2)
    assert found["noise"].speed == pytest.approx(length / time * plain["noise"].speed, rel=1e-3)


def test_one_inertial_number_determines_no_law(inspected: Inspection) -> None:
    """Bagnold's flow has the same I everywhere."""
    text = said(inspect(chute(frames=12, columns=20)))
    assert "mu_s and mu_2 not determined: the grains shear at I = 0." in text
    assert "not determined" not in said(inspected)


def test_precision_falls_with_noise_and_rises_with_vectors(demo: Flow, seed: int) -> None:
    flow = add_noise(demo, 0.2, seed)
    u, v = flow.u.copy(), flow.v.copy()
    gone = np.random.default_rng(seed).uniform(size=u.shape) < 0.75
    u[gone] = v[gone] = np.nan
    little, much, quarter = (
        inspect(f)["precision"].expected["mu_2"]
        for f in (add_noise(demo, 0.02, seed), flow, replace(flow, u=u, v=v))
    )
    assert little < much < quarter
