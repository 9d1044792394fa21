"""Steady flows, and flows that are the same along x: what the file states and the data confirm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from granpinn.data import (
    Flow,
    FlowFileError,
    Particles,
    Surface,
    add_noise,
    check_flow,
    particle_flow,
    read_flow,
    write_flow,
)
from granpinn.data.scaling import initial_height, scales_of
from granpinn.data.symmetry import axes_of, invariant_axes, same_along_x, with_layer, words
from granpinn.training.points import training_set
from tests.flows import make_chute, make_flow

ALL_FRAMES = 4


def wavy(flow: Flow, size: float, waves: int = 1) -> Flow:
    """The flow with a velocity that varies along x by a part `size` of it (rms)."""
    wave = np.sqrt(2) * size * np.cos(2 * np.pi * waves * flow.x / 32)
    return replace(flow, u=(flow.u * (1 + wave)).astype(np.float32))


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_a_flow_file_keeps_what_it_states(tmp_path: Path, frames: int) -> None:
    flow = make_chute(frames=frames)
    write_flow(flow, tmp_path / "chute.h5")
    found = read_flow(tmp_path / "chute.h5")
    assert found.t.size == frames
    assert found.steady
    assert found.stated("period_x") == 32
    assert found.attributes == flow.attributes
    np.testing.assert_array_equal(found.u, flow.u)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "not steady with one frame": (
        {"steady": 0},
        "a flow of one frame must be steady, got the attribute steady = 0",
    ),
    "steady in words": ({"steady": "yes"}, "steady must be 1 in a steady flow and 0 in any other"),
    "very steady": ({"steady": 2}, "steady must be 1 in a steady flow and 0 in any other, got 2"),
    "no period": ({"period_x": 0}, "period_x must be from 1e-30 to 1e+30, got"),
    "endless period": ({"period_x": float("inf")}, "period_x must be from 1e-30 to 1e+30, got"),
    "period of NaN": ({"period_x": float("nan")}, "period_x must be from 1e-30 to 1e+30, got"),
    "period in words": ({"period_x": "32"}, "period_x must be a number, got"),
    "no gap": ({"wall_gap": 0}, "wall_gap must be from 1e-30 to 1e+30, got"),
    "window of 0": (
        {"interrogation_window": 0},
        "interrogation_window must be from 1e-30 to 1e+30, got",
    ),
    "gap of NaN": ({"wall_gap": float("nan")}, "wall_gap must be from 1e-30 to 1e+30, got"),
    "gap in words": ({"wall_gap": "20 mm"}, "wall_gap must be a number, got"),
    "period in another unit": ({"period_x": 0.032}, "period_x must be longer than x, which spans"),
    "no line": ({"surface_sd": -1.0}, "surface_sd must be from 0"),
    "endless line": ({"surface_sd": float("inf")}, "surface_sd must be from 0"),
    "line of NaN": ({"surface_sd": float("nan")}, "surface_sd must be from 0"),
    "line in words": ({"surface_sd": "half a grain"}, "surface_sd must be a number, got"),
    "line in another unit": (
        {"surface_sd": 1250.0},
        "surface_sd must be smaller than the height of the grains",
    ),
}


@pytest.mark.parametrize(("attributes", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_statements_are_refused(attributes: dict[str, Any], message: str) -> None:
    with pytest.raises(FlowFileError) as caught:
        check_flow(make_chute(attributes=attributes))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [np.array([1, 1]), np.bytes_(b"yes"), 2])
def test_statements_that_are_no_number_are_not_overlooked(tmp_path: Path, value: Any) -> None:
    write_flow(make_flow(), tmp_path / "flow.h5")
    with h5py.File(tmp_path / "flow.h5", "r+") as file:
        file.attrs["steady"] = value
    with pytest.raises(FlowFileError, match="steady"):
        read_flow(tmp_path / "flow.h5")


def test_a_steady_flow_has_no_start() -> None:
    """Its vectors count at any time; those of other flows count after t = 0."""
    for frames in (1, 3):
        flow = make_chute(frames=frames)
        flow = replace(flow, t=flow.t - 100)
        data = training_set(flow, scales_of(flow))
        assert len(data.points) == flow.valid.sum()
        assert len(data.surface_points) == len(flow.x) * frames
    moving = make_flow()
    moving = replace(moving, t=moving.t - 100, surface=None)
    with pytest.raises(FlowFileError, match="start the clock"):
        training_set(moving, scales_of(moving), "V0")


@pytest.mark.parametrize("frames", [1, ALL_FRAMES])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_a_chute_is_the_same_along_x(frames: int, noise: float, seed: int) -> None:
    flow = add_noise(make_chute(frames=frames, columns=32), noise, seed)
    assert invariant_axes(flow) == (True, False, True)
    assert words(invariant_axes(flow)) == (
        "the same along x: no derivative along x",
        "steady: no time derivative",
    )


@pytest.mark.parametrize("frames", [1, ALL_FRAMES])
@pytest.mark.parametrize("waves", [1, 3])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_wave_along_x_is_kept(frames: int, waves: int, noise: float, seed: int) -> None:
    flow = make_chute(frames=frames, columns=32)
    assert not same_along_x(add_noise(wavy(flow, 0.06, waves), noise, seed))
    assert same_along_x(wavy(flow, 0.01, waves))


def test_a_layer_keeps_its_axes_and_its_thickness() -> None:
    """On a gentle slope too; the length of the window does not matter."""
    gentle = make_chute(gravity=(0.1, -1.0))
    assert axes_of(gentle).sin == 0
    assert axes_of(gentle).gravity == pytest.approx((0.0995, -0.995), abs=1e-3)
    assert axes_of(replace(gentle, attributes={})).sin != 0
    long = make_chute(columns=8)
    assert initial_height(gentle) == initial_height(long) == pytest.approx(12.0)


def test_scattered_vectors_of_one_time(tmp_path: Path, seed: int) -> None:
    draw = np.random.default_rng(seed)
    x, y = draw.uniform(0, 32, 600), draw.uniform(0, 12, 600)
    vectors = Particles(np.full(600, 3.0), x, y, 0.1 * y, draw.normal(0, 0.01, 600))
    line = Surface(np.full(9, 3.0), np.linspace(1, 31, 9), np.full(9, 12.0))
    flow = particle_flow(
        vectors,
        gravity=(0.4, -1.0),
        density=1.0,
        grain_diameter=1.0,
        surface=line,
        attributes={"period_x": 32.0},
    )
    write_flow(flow, tmp_path / "tracks.h5")
    flow = read_flow(tmp_path / "tracks.h5")
    assert invariant_axes(flow) == (True, False, True)
    assert len(training_set(flow, scales_of(flow)).points) == 600
    noisy = add_noise(flow, 0.1, seed)
    check_flow(noisy)
    assert noisy.steady


def without_period(flow: Flow) -> Flow:
    return replace(flow, attributes={k: v for k, v in flow.attributes.items() if k != "period_x"})


def test_data_alone_show_a_layer_that_is_the_same_along_x() -> None:
    layer = without_period(make_chute(frames=5))
    found = with_layer(layer)
    assert found.periodic
    assert found.attributes == layer.attributes
    assert same_along_x(found)
    for other in (wavy(layer, 0.1), replace(layer, surface=None), make_flow()):
        assert with_layer(other) is other
