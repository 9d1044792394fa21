"""Large flows: read in place, checked in slabs, and represented by some of their frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.scale import write_flow_file
from granpinn.config import ConfigError
from granpinn.config.settings import Config
from granpinn.data import (
    Flow,
    FlowFileError,
    Particles,
    TrainingSet,
    check_flow,
    large,
    particle_flow,
    points,
    read_flow,
    training_set,
    with_partial_cells,
)
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.estimates.gradients import BETWEEN_RUNS
from granpinn.fit import case
from tests.data.test_variants import walled
from tests.flows import make_flow

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


def test_small_and_scattered_flows_are_used_as_they_are() -> None:
    flow = make_flow()
    assert large.slabs(flow) == [slice(0, flow.t.size)]
    assert flow is large.spread(flow) is large.runs(flow)
    t, x = np.repeat([0.1, 0.2], 50), np.tile(np.linspace(0, 1, 50), 2)
    u = np.ones(100, np.float32)
    particles = Particles(t, x, x**2, u, u)
    scattered = particle_flow(particles, gravity=(0, -1), density=1.0, grain_diameter=0.01)
    assert not large.is_large(replace(scattered, c=np.broadcast_to(np.float32(1), (2**12, 64, 64))))


@pytest.mark.usefixtures("bounds")
def test_slabs_hold_every_frame_once(path: Path) -> None:
    flow = read_flow(path)
    parts = large.slabs(flow)
    assert np.concatenate([np.arange(FRAMES)[k] for k in parts]).tolist() == [*range(FRAMES)]
    assert min(k.stop - k.start for k in parts) > 1
    for frames in range(21, 60):
        last = large.slabs(large.some_frames(flow, slice(0, frames)))[-1]
        assert last.stop == frames
        assert last.stop - last.start > 1


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
def test_runs_and_spread_frames_are_those_of_the_flow(path: Path) -> None:
    flow = read_flow(path)
    runs, spread = large.runs(flow), large.spread(flow)
    assert runs.starts == (0, 10)
    assert runs.t.tolist() == [*flow.t[:10], *flow.t[50:]]
    np.testing.assert_array_equal(runs.u, np.concatenate([flow.u[:10], flow.u[50:]]))
    assert spread.t.size == 20
    assert (spread.t[0], spread.t[-1]) == (flow.t[0], flow.t[-1])
    for part in (runs, spread):
        assert part.surface is not None
        assert np.unique(part.surface.t).tolist() == part.t.tolist()
        assert part.surface.t.size == CELLS * part.t.size


@pytest.mark.usefixtures("bounds")
def test_no_estimate_joins_two_runs(path: Path) -> None:
    """The second run is far faster: a slope or difference across the gap would show it."""
    flow = read_flow(path)
    still = replace(flow, u=np.where(np.isnan(flow.u), np.nan, flow.u * 0 + 1.0), v=0 * flow.v)
    still.u[30:] *= 100
    runs = large.runs(still)
    facts = Facts(runs, scales_of(flow))
    assert facts.noise.sigma == 0.0
    assert len(facts.view.t) == 20 + BETWEEN_RUNS
    assert facts.view.count.sum() == runs.valid.sum()
    assert np.abs(facts.slopes.du[:, 0]).max() < 1e-9
    assert facts.independent(12345) * facts.noise.vectors_per_independent == 12345


def sets_of(flow: Flow, level: str) -> tuple[TrainingSet, TrainingSet]:
    """The training set in one slab, and slab by slab."""
    settings = scales_of(flow), level, torch.float64, 1.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(large, "MOST_CELLS", flow.c.size)
        patch.setattr(points, "MOST_VECTORS", flow.c.size)
        whole = training_set(with_partial_cells(flow), *settings)
    return whole, training_set(flow, *settings)


def with_sigmas(flow: Flow) -> Flow:
    sigma = np.linspace(0.01, 0.02, flow.u.size, dtype=np.float32).reshape(flow.u.shape)
    return replace(flow, sigma_u=sigma, sigma_v=2 * sigma)


def mild() -> Flow:
    return make_flow(frames=30, rows=12, columns=16, p=None, truth=None)


@pytest.mark.usefixtures("bounds")
@pytest.mark.parametrize("level", ["V0", "V1", "V2"])
@pytest.mark.parametrize("flow", [mild(), with_sigmas(mild())], ids=["heap", "sigmas"])
def test_slabs_have_the_vectors_of_the_whole(flow: Flow, level: str) -> None:
    assert large.is_large(flow)
    whole, made = sets_of(flow, level)
    same = ("points", "velocity", "surface_points", "surface_pressure", "lower", "upper")
    for name in same:
        assert torch.equal(getattr(made, name), getattr(whole, name)), name
    torch.testing.assert_close(made.point_weights[:, 0], whole.point_weights[:, 0])
    of_strips = []
    for own in (made, whole):
        torch.testing.assert_close(own.pooled().point_weights.mean(0), torch.ones(2).double())
        N, B = len(own.points), len(own.between)
        weights = torch.cat([own.point_weights[:, 1], own.equation_weights])
        assert len(weights[: N + B].unique()) == 1
        of_strips.append(float(weights[N + B :].sum() / weights[N : N + B].sum()))
    assert of_strips[0] == pytest.approx(of_strips[1], rel=1e-2)
    assert len(made.between) == len(whole.points)
    middle, expected = (s.between.mean(0).numpy() for s in (made, whole))
    np.testing.assert_allclose(middle, expected, rtol=0.15, atol=0.05)


@pytest.mark.usefixtures("bounds")
def test_slabs_have_the_walls_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    flow = walled()
    monkeypatch.setattr(large, "MOST_CELLS", flow.c.size - 1)
    monkeypatch.setattr(large, "SLAB_CELLS", 3 * flow.c[0].size)
    whole, made = sets_of(flow, "V1")
    for name in ("wall_points", "wall_velocity", "surface_points", "surface_pressure"):
        assert torch.equal(getattr(made, name), getattr(whole, name)), name


@pytest.mark.usefixtures("bounds")
def test_every_fourth_frame_trains(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flow = replace(read_flow(path), attributes={"grid_spacing_of_solver": 0.01})
    settings = scales_of(flow), "V1", torch.float64, 1.0
    count, _ = points.vector_counts(flow)
    monkeypatch.setattr(points, "MOST_VECTORS", count // 4)
    some = large.some_frames(flow, slice(0, None, 4))
    assert len(some.t) == FRAMES // 4
    made, expected = training_set(flow, *settings), training_set(some, *settings)
    assert len(made.points) == count // 4
    for name, values in expected.arrays().items():
        assert torch.equal(getattr(made, name), values), name


@pytest.mark.usefixtures("bounds")
def test_what_a_large_flow_does_not_allow_is_refused(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ConfigError, match="flows of at most 5,120 cells, got 15,360"):
        case.pose(path, Config(noise=0.01, device="cpu"))
    monkeypatch.setattr(case, "available", lambda: 10**9)
    with pytest.raises(
        ConfigError, match=r"points 1.68, .* got 1 GB: choose a smaller batch.colloc"
    ):
        case.pose(path, Config(members=4, device="cpu"))
