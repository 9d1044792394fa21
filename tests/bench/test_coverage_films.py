"""Films of random collapses at a tiny size, with true vectors in the place of the PIV."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bench.studies.coverage import films
from granpinn.data import read_flow
from tests.bench.test_chain import true_vectors


def test_a_film_has_the_grains_and_the_speed_of_its_collapse(tmp_path: Path) -> None:
    """The flow file is in SI units: speeds scale with sqrt(g height), diameters with the height."""
    (task,) = films.tasks_of(1, 3)
    small = dataclasses.replace(task, scene=dataclasses.replace(task.scene, cells=64))
    path = films.measured(small, tmp_path, true_vectors, pairs=4, across=200)
    flow, like = read_flow(path), task.scene
    assert flow.grain_density is not None
    density = np.sqrt(flow.grain_density / flow.density)
    assert flow.grain_diameter * density == pytest.approx(0.1 * like.d / like.height)
    speed = np.nanmax(np.hypot(flow.u, flow.v)) / np.sqrt(9.81 * 0.1)
    assert 0.3 < speed < 1.5
    assert len(flow.t) == 4

    def no_piv(*_: object) -> None:
        raise AssertionError("the film is there")

    assert films.measured(small, tmp_path, no_piv) == path
