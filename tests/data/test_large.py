"""Large flows: read in place, checked in slabs, and represented by some of their frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.scale import write_flow_file
from granpinn.data import (
    FlowFileError,
    Particles,
    check_flow,
    large,
    particle_flow,
    read_flow,
)
from granpinn.inspection import Inspection
from tests.flows import make_chute, make_flow

FRAMES, CELLS = 60, 16


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("large") / "flow.h5"
    write_flow_file(path, FRAMES, CELLS)
    return path


@pytest.fixture
def bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything above 20 frames of the file is large; slabs have 7 frames."""
    monkeypatch.setattr(large, "MOST_CELLS", 20 * CELLS**2)
    monkeypatch.setattr(large, "SLAB_CELLS", 7 * CELLS**2)


def test_a_file_above_the_limit_stays_in_place(path: Path) -> None:
    kept, mapped = read_flow(path), read_flow(path, max_bytes=1000)
    assert mapped.sha256 == kept.sha256
    for name in ("t", "x", "y", "c", "u", "v"):
        array = getattr(mapped, name)
        assert not array.flags.owndata
        assert not array.flags.writeable
        np.testing.assert_array_equal(array, getattr(kept, name))


def test_small_and_scattered_flows_are_used_as_they_are(path: Path) -> None:
    flow = make_flow()
    assert large.slabs(flow) == [slice(0, flow.t.size)]
    assert flow is large.thinned(flow)
    t, x = np.repeat([0.1, 0.2], 50), np.tile(np.linspace(0, 1, 50), 2)
    u = np.ones(100, np.float32)
    particles = Particles(t, x, x**2, u, u)
    scattered = particle_flow(particles, gravity=(0, -1), density=1.0, grain_diameter=0.01)
    many = replace(scattered, c=np.broadcast_to(np.float32(1), (2**12, 64, 64)))
    assert large.thinned(many) is many


@pytest.mark.usefixtures("bounds")
def test_slabs_hold_every_frame_once(path: Path) -> None:
    parts = large.slabs(read_flow(path))
    assert np.concatenate([np.arange(FRAMES)[k] for k in parts]).tolist() == [*range(FRAMES)]
    assert max(k.stop - k.start for k in parts) == 7


@pytest.mark.usefixtures("bounds")
@pytest.mark.parametrize(
    ("field", "value", "found"),
    [
        ("u", np.inf, "u must be from .* got inf"),
        ("v", np.nan, "got 1 where only one of them is"),
        ("c", 1.5, "c must be from -1e-06 to 1, got 1.5"),
        ("c", np.nan, "c must be from -1e-06 to 1, got nan"),
    ],
)
def test_faults_of_the_last_slab_are_found(
    path: Path, field: str, value: float, found: str
) -> None:
    flow = read_flow(path)
    values = getattr(flow, field).copy()
    values[-1, 0, 3] = value
    with pytest.raises(FlowFileError, match=found):
        check_flow(replace(flow, **{field: values}))


@pytest.mark.usefixtures("bounds")
def test_every_nth_frame_is_used(path: Path) -> None:
    """As if the film had fewer frames, with the points of the surface of these."""
    flow = read_flow(path)
    few = large.thinned(flow)
    assert few.every == 3
    assert few.t.tolist() == flow.t[::3].tolist()
    np.testing.assert_array_equal(few.u, flow.u[::3])
    assert few.surface is not None
    assert np.unique(few.surface.t).tolist() == few.t.tolist()
    assert few.surface.t.size == CELLS * few.t.size
    two = large.thinned(replace(few, c=np.broadcast_to(np.float32(1), (20, 2**12, 64))))
    assert two.t.tolist() == [few.t[0], few.t[19]]


def test_all_frames_of_a_steady_flow_are_averaged(monkeypatch: pytest.MonkeyPatch) -> None:
    flow = make_chute(frames=24)
    monkeypatch.setattr(large, "MOST_CELLS", 6 * flow.c[0].size)
    found = Inspection(flow).flow
    assert (found.t.size, found.averaged, found.every) == (1, 24, 1)
