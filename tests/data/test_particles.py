"""The particle layout: scattered vectors are kept unchanged, and errors are one sentence."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch

from granpinn import Config, identify
from granpinn.data import (
    Flow,
    FlowFileError,
    Particles,
    check_flow,
    particle_flow,
    read_flow,
    write_flow,
)
from granpinn.data import particles as particles_module
from granpinn.data.scaling import RESOLUTION, inertial_diameter, scales_of
from granpinn.training.points import training_set
from tests import flows
from tests.flows import make_flow

GRID = make_flow()


def scattered(flow: Flow = GRID, **changes: Any) -> Flow:
    """The valid vectors of a grid in random order, each with its own standard deviation."""
    vectors = vars(flows.scattered(flow).particles)
    n = vectors["t"].size
    order = np.random.default_rng(5).permutation(n)
    sigma = (0.01 + 0.01 * np.arange(n) / n).astype(np.float32)
    vectors = {name: vectors[name][order] for name in "txyuv"}
    vectors |= {"sigma_u": sigma, "sigma_v": sigma}
    particles = Particles(**(vectors | changes))
    density = {"density_unit": "kg/m^3", "grain_density": 2500.0}
    return flows.scattered(flow, particles=particles, **density)


FLOW = scattered()
PARTICLES = FLOW.particles
assert PARTICLES is not None


def test_a_file_returns_every_vector(tmp_path: Path) -> None:
    write_flow(FLOW, tmp_path / "flow.h5")
    back = read_flow(tmp_path / "flow.h5")
    assert back.particles is not None
    for name, values in vars(PARTICLES).items():
        np.testing.assert_array_equal(getattr(back.particles, name), values)
    for name in ("t", "y", "x", "u", "v", "c"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FLOW, name))
    assert (back.density_unit, back.grain_density) == ("kg/m^3", 2500.0)
    with h5py.File(tmp_path / "flow.h5") as file:
        assert "u" not in file
        assert file["particles/u"].attrs["units"] == b"m/s"
        assert file["particles/u"].dims[0][0].name == "/particles/t"


def test_training_takes_the_vectors_as_they_are() -> None:
    scales = scales_of(FLOW)
    data = training_set(FLOW, scales, dtype=torch.float64)
    expected = scales.points_to_dimensionless(PARTICLES.x, PARTICLES.y, PARTICLES.t)
    half = 0.5001 * RESOLUTION
    np.testing.assert_allclose(data.points.numpy(), expected, rtol=0, atol=half)
    u = PARTICLES.u.astype(float) / scales.velocity
    np.testing.assert_allclose(data.velocity[:, 0].numpy(), u, rtol=0, atol=half)
    variance = PARTICLES.sigma_u.astype(float) ** 2
    weight = 1 / (variance + np.median(variance))
    np.testing.assert_allclose(data.point_weights[:, 0].numpy(), weight / weight.mean(), rtol=1e-6)


def test_the_view_shows_where_grains_are() -> None:
    """Its grains cover the area of the grid's cells to a fifth, and a cell has their mean."""
    areas = [f.material.sum((1, 2)) * (f.x[1] - f.x[0]) * (f.y[1] - f.y[0]) for f in (FLOW, GRID)]
    assert FLOW.t.size == GRID.t.size
    np.testing.assert_allclose(areas[0], areas[1], rtol=0.35)
    assert areas[0].sum() == pytest.approx(areas[1].sum(), rel=0.2)
    k, j, i = 4, 2, 1
    half = (FLOW.x[1] - FLOW.x[0]) / 2
    inside = (np.abs(PARTICLES.x - FLOW.x[i]) < half) & (np.abs(PARTICLES.y - FLOW.y[j]) < half)
    inside &= PARTICLES.t == FLOW.t[k]
    assert inside.sum() > 1
    assert FLOW.u[k, j, i] == pytest.approx(PARTICLES.u[inside].mean(), rel=1e-6)


def with_nan(name: str) -> dict[str, Any]:
    values = getattr(PARTICLES, name).copy()
    values[7] = np.nan
    return {name: values}


WRONG = {
    "NaN": (with_nan("v"), "particles/v must be from .* got nan at index 7"),
    "time of NaN": (with_nan("t"), "particles/t must be from"),
    "sigma": ({"sigma_u": -PARTICLES.sigma_u}, "particles/sigma_u must be from 1e-30"),
    "one sigma": ({"sigma_v": None}, "must come together"),
    "one place": (
        {"x": np.zeros_like(PARTICLES.x), "y": np.zeros_like(PARTICLES.y)},
        "spread over an area",
    ),
    "far away": ({"x": PARTICLES.x + 1e17}, "spread over an area|vary by more than its rounding"),
}


@pytest.mark.parametrize(("changes", "message"), WRONG.values(), ids=WRONG.keys())
def test_wrong_vectors_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(FlowFileError, match=message) as caught:
        check_flow(scattered(**changes))
    assert "\n" not in str(caught.value)


def edit(tmp_path: Path, change: Any) -> Path:
    write_flow(FLOW, tmp_path / "flow.h5")
    with h5py.File(tmp_path / "flow.h5", "a") as file:
        change(file)
    return tmp_path / "flow.h5"


def _both(file: h5py.File) -> None:
    file["u"] = GRID.u


def _missing(file: h5py.File) -> None:
    del file["particles/y"]


def _outside(file: h5py.File) -> None:
    del file["particles/u"]
    file["particles/u"] = h5py.ExternalLink("elsewhere.h5", "/u")


def _no_group(file: h5py.File) -> None:
    del file["particles"]
    file["particles"] = 1.0


EDITS = {
    "both layouts": (_both, "on a grid or at particles, got both u and particles/t"),
    "no y": (_missing, "particles/y is missing: expected a dataset particles/y float64 \\[N\\]"),
    "link": (_outside, "particles/u must be stored in the file itself"),
    "no group": (_no_group, "particles must be a group"),
}


@pytest.mark.parametrize(("change", "message"), EDITS.values(), ids=EDITS.keys())
def test_wrong_files_are_refused(tmp_path: Path, change: Any, message: str) -> None:
    with pytest.raises(FlowFileError, match=message):
        read_flow(edit(tmp_path, change))


def test_density_of_grains_enters_the_inertial_number() -> None:
    r"""$I = d \dot\gamma / \sqrt{p/\rho_g}$: in units of rho g H for p, d grows by sqrt(rho_g/rho).

    At the same physical state the inertial number from dimensionless quantities is the one from
    physical ones.
    """
    scales = scales_of(FLOW)
    d = inertial_diameter(FLOW, scales)
    rate, p = 7.0, 640.0  # 1/s, Pa
    physical = FLOW.grain_diameter * rate / math.sqrt(p / 2500.0)
    ours = d * scales.to_dimensionless(rate, "rate")
    ours /= math.sqrt(scales.to_dimensionless(p, "pressure"))
    assert ours == pytest.approx(physical, rel=1e-12)
    merged = inertial_diameter(replace(FLOW, grain_density=None), scales)
    assert d / merged == pytest.approx(math.sqrt(2500 / 1500), rel=1e-12)
    with pytest.raises(FlowFileError, match="grain_density must be at least density"):
        check_flow(replace(FLOW, grain_density=1499.0))


def test_particles_are_trained_on_and_drawn(tmp_path: Path) -> None:
    """All of the chain: file, training, fields on the view, results; the vectors are scored."""
    write_flow(FLOW, tmp_path / "flow.h5")
    small = Config(steps=3, device="cpu", network=replace(Config().network, widths=(8,)))
    result = identify(tmp_path / "flow.h5", small, run_dir=tmp_path / "run")
    assert result.data.n_points == PARTICLES.t.size
    assert result.error_percent.velocity is not None
    with h5py.File(tmp_path / "run" / "fields.h5") as file:
        assert file["p"].shape == FLOW.c.shape
        assert file["p"].attrs["units"] == b"Pa"
        assert np.isfinite(file["u"][:][FLOW.material]).all()


@pytest.mark.parametrize("times", [1500, 3000])
@pytest.mark.parametrize("pause", [0.0, 0.1])
def test_a_pause_of_the_measurement_is_no_fault(times: int, pause: float) -> None:
    """More times than the view has frames: those of the pause have no vectors."""
    rng = np.random.default_rng(times)
    t = np.sort(rng.random(times))
    t[times // 2 :] += pause
    place, velocity = rng.random((2, 2, 3 * times))
    flow = particle_flow(
        Particles(np.repeat(t, 3), *place, *velocity),
        gravity=(0.0, -9.81),
        density=1500.0,
        grain_diameter=0.01,
    )
    check_flow(flow)
    assert 2 <= flow.t.size <= particles_module.MAX_FRAMES
    assert np.isfinite(flow.u).any(axis=(1, 2)).all()
    middle = flow.t[:-1] + np.diff(flow.t) / 2
    there = (middle > t[times // 2 - 1] + 0.01) & (middle < t[times // 2] - 0.01)
    assert there.sum() <= 1  # one interval over the pause
