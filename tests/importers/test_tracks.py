"""Tracked particles: velocities and their standard deviations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError
from granpinn.importers.tracks import velocities

N_TRACKS, N_FRAMES = 40, 12
A, B, C = 0.3, 1.5, -0.04  # a parabola in px and frames, exact for the local fit


def motion(noise: float = 0.0, tracks: int = N_TRACKS) -> dict[str, Any]:
    """Columns of a table: every track starts elsewhere, the order is random."""
    rng = np.random.default_rng(7)
    frame, particle = np.meshgrid(np.arange(N_FRAMES), np.arange(tracks))
    frame, particle = frame.ravel(), particle.ravel()
    start = rng.uniform(0, 500, (2, tracks))[:, particle]
    x = start[0] + A * particle % 3 + B * frame + C * frame**2
    y = start[1] + 0.5 * frame
    order = rng.permutation(frame.size)
    columns = {"y": y, "x": x, "frame": frame, "particle": particle}
    columns = {name: np.asarray(values, float)[order] for name, values in columns.items()}
    for name in ("x", "y"):
        columns[name] += noise * rng.standard_normal(order.size)
    return columns


def write_csv(path: Path, columns: dict[str, Any], delimiter: str = ",") -> Path:
    rows = [delimiter.join(columns)]
    rows += [
        delimiter.join(f"{c:.12g}" for c in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def test_no_motion_along_an_axis_has_a_standard_deviation() -> None:
    c = motion()
    found = velocities(c["frame"], c["frame"], c["x"], 0 * c["x"], c["particle"], None, 5)
    assert (found["sigma_v"].astype(np.float32) > 0).all()


@pytest.mark.parametrize("given", [True, False], ids=["ep", "scatter"])
def test_standard_deviations_are_true(given: bool) -> None:
    """The errors of u over their standard deviations are standard normal, at the ends too."""
    noise = 0.05
    c = motion(noise, tracks=400)
    ep = np.full(c["x"].size, noise) if given else None
    found = velocities(c["frame"], c["frame"], c["x"], c["y"], c["particle"], ep, 5)
    score = (found["u"] - (B + 2 * C * c["frame"])) / found["sigma_u"]
    ends = np.isin(c["frame"], (0, N_FRAMES - 1))
    for part in (ends, ~ends):
        # 800 and 4000 scores, five of which share a window: 3 standard errors of their spread.
        assert np.std(score[part]) == pytest.approx(1, abs=0.1)
    assert found["sigma_u"][ends].min() > 2 * found["sigma_u"][~ends].max()


def test_short_tracks_and_gaps() -> None:
    """Two observations are no track; a missing frame is bridged by those around it."""
    frame = np.array([0, 1, 0, 1, 3, 4, 5.0])
    particle = np.array([0, 0, 1, 1, 1, 1, 1.0])
    x = 3 + 2 * frame
    found = velocities(frame, frame, x, x, particle, None, 5)
    assert np.isnan(found["u"][:2]).all()
    np.testing.assert_allclose(found["u"][3:], 2, rtol=1e-12)


def test_wrong_tracks_are_refused() -> None:
    frame = np.zeros(4)
    for window in (1, 4):
        with pytest.raises(DataFileError, match="track_window must be odd and at least 3"):
            velocities(frame, frame, frame, frame, np.arange(4.0), None, window)
