"""An identification of a large flow: every n-th frame is used."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.scale import write_flow_file
from granpinn.data import large, read_flow
from granpinn.identification.identified import Identification
from granpinn.identification.identify import identify
from tests.runs import Heard, tiny

FRAMES, CELLS = 60, 16


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Identification, Path, list[str]]:
    folder, heard = tmp_path_factory.mktemp("large"), Heard()
    write_flow_file(folder / "flow.h5", FRAMES, CELLS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(large, "MOST_CELLS", 20 * CELLS**2)
        patch.setattr(large, "SLAB_CELLS", 7 * CELLS**2)
        flow = read_flow(folder / "flow.h5", max_bytes=1000)  # used in its file
        found = identify(flow, tiny(), run_dir=folder / "run", progress=heard)
    return found, folder / "run", heard.said


def test_the_result_says_what_was_sampled(run: tuple[Identification, Path, list[str]]) -> None:
    found, folder, messages = run
    data = json.loads((folder / "results.json").read_text())["data"]
    assert data["n_frames"] == 20
    assert data["n_points"] == 20 * CELLS**2 // 2
    assert data["sampled"] == found.data.sampled
    assert data["sampled"] == "large flow: 20 frames are used, one of every 3"
    assert data["sampled"] in messages


def test_fields_are_those_of_some_frames(run: tuple[Identification, Path, list[str]]) -> None:
    found, _, _ = run
    fields = found.fields
    assert fields.sizes["t"] == 20
    np.testing.assert_allclose(fields.t[[0, 1]], [2.0 / FRAMES, 8.0 / FRAMES])
    assert np.isfinite(fields.u).sum() == 20 * CELLS**2 // 2
