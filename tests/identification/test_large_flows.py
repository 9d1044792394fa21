"""An identification of a large flow: all of its frames train, some of them have fields."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.scale import write_flow_file
from granpinn.data import large, points, read_flow
from granpinn.identification.identified import Identification
from granpinn.identification.single import identify
from tests.runs import Heard, tiny

FRAMES, CELLS, VECTORS = 60, 16, 2000


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Identification, Path, list[str]]:
    folder, heard = tmp_path_factory.mktemp("large"), Heard()
    write_flow_file(folder / "flow.h5", FRAMES, CELLS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(large, "MOST_CELLS", 20 * CELLS**2)
        patch.setattr(large, "SLAB_CELLS", 7 * CELLS**2)
        patch.setattr(points, "MOST_VECTORS", VECTORS)
        flow = read_flow(folder / "flow.h5", max_bytes=1000)  # used in its file
        found = identify(flow, tiny(), run_dir=folder / "run", progress=heard)
    return found, folder / "run", heard.said


def test_the_result_says_what_was_sampled(run: tuple[Identification, Path, list[str]]) -> None:
    found, folder, messages = run
    data = json.loads((folder / "results.json").read_text())["data"]
    assert data["n_frames"] == FRAMES
    assert data["n_points"] == FRAMES * CELLS**2 // 2 // 4
    assert data["sampled"] == found.data.sampled
    assert f"{data['n_points']:,} vectors of 15 of 60 frames train" in data["sampled"]
    assert "20 frames in 2 runs; fields, figures and errors are those of 20" in data["sampled"]
    assert data["sampled"].startswith("large flow: ")
    assert data["sampled"] in messages


def test_fields_are_those_of_some_frames(run: tuple[Identification, Path, list[str]]) -> None:
    found, _, _ = run
    fields = found.fields
    assert fields.sizes["t"] == 20
    np.testing.assert_allclose(fields.t[[0, -1]], [2.0 / FRAMES, 2.0])
    assert np.isfinite(fields.u).sum() == 20 * CELLS**2 // 2
