"""The experiment without a laboratory at a tiny size, with true vectors in the place of the PIV."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.studies.experiment.commands import convert
from bench.studies.experiment.film import Film, column, shoot
from granpinn.simulation import Collapse

WINDOW = 8
INVALID = 7  # every seventh vector


def true_vectors(film: Film, out: Path) -> None:
    """What a perfect PIV would write as OpenPIV does: px per pair, y up, zeros where masked."""
    out.mkdir()
    camera, half = film.camera, WINDOW // 2
    columns = np.arange(half, camera.columns - half + 1, half)
    rows = np.arange(half, camera.rows - half + 1, half)[::-1]
    x, y = (a.ravel().astype(float) for a in np.meshgrid(columns, rows))
    for k, t in enumerate(film.times):
        u, v = film.field.velocity(t, x * camera.pixel, y * camera.pixel)
        masked = film.field.fraction(t, x * camera.pixel, y * camera.pixel) < 0.5
        flags = np.arange(x.size) % INVALID == 0
        u, v = (np.where(masked, 0, a * film.delay / camera.pixel) for a in (u, v))
        u[flags] = 9.9  # replaced by anything: it must not be used
        np.savetxt(
            out / f"field_A{k:04d}.txt",
            np.stack([x, y, u, v, flags, masked], axis=1),
            fmt="%.4e",
            delimiter="\t",
            header="x\ty\tu\tv\tflags\tmask",
        )


def test_true_vectors_lose_nothing(tmp_path: Path) -> None:
    """Rounding to five digits is all that happens to them; the line is off by a pixel or so."""
    collapse = Collapse(0.4, 0.64, cells=64)
    film = shoot(column(64, 16, collapse), 4, 4e-4, 8.0, tmp_path, seed=0)
    true_vectors(film, tmp_path / "vectors")
    flow = convert(film, tmp_path / "vectors", tmp_path)
    assert (flow.length_unit, flow.time_unit) == ("m", "s")
    assert flow.truth is None
    np.testing.assert_allclose(flow.t, film.times, atol=1e-9)
    rejected = np.isnan(flow.u[flow.c == 1]).mean()
    assert rejected == pytest.approx(1 / INVALID, abs=0.02)
    x, y = (a.ravel() for a in np.meshgrid(flow.x, flow.y))
    true = np.array([film.field.velocity(t, x, y) for t in film.times]).reshape(
        4, 2, *flow.u.shape[1:]
    )
    found = np.stack([flow.u, flow.v], axis=1)
    error = np.where(np.isfinite(found), found - true, 0)
    assert np.linalg.norm(error) < 1e-4 * np.linalg.norm(true[np.isfinite(found)])
    # Corners are rounded by the radius of the mean, 4 px.
    line = flow.surface
    assert line is not None
    for t, a, b in zip(line.t, line.x, line.y, strict=True):
        away = 5 * film.camera.pixel
        around = [(a + way * away, b + up * away) for way in (-1, 0, 1) for up in (-1, 0, 1)]
        inside = [film.field.fraction(t, *map(np.atleast_1d, at))[0] for at in around]
        assert min(inside) < 0.5 < max(inside)
