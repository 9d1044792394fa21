"""The blocks of guides in Python run, with few steps, a small network and a small flow."""

from __future__ import annotations

import contextlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch

from granpinn.data import FlowFileWarning, read_flow, write_flow
from granpinn.kernels.network import drawn_parameters
from tests.flows import make_flow

GUIDES = Path(__file__).parents[2] / "docs" / "guides"
FEWER = "steps=5, network__widths=(8, 8)"
BLOCK = re.compile(r"^<!-- run -->\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def test_the_law_of_the_page_is_identified(tmp_path: Path) -> None:
    (text,) = BLOCK.findall((GUIDES / "own-law.md").read_text())
    assert text.count("steps=6000") == 1
    write_flow(make_flow(), tmp_path / "flow.h5")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", text.replace("steps=6000", FEWER)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^b +[0-9.]+$", done.stdout, re.MULTILINE)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


def test_a_step_of_another_equation_changes_the_network(tmp_path: Path) -> None:
    (text,) = BLOCK.findall((GUIDES / "other-equations.md").read_text())
    program = tmp_path / "step.py"
    program.write_text(text)
    found = runpy.run_path(str(program))
    assert found["residual"].shape == (2048, 1)
    assert not torch.equal(found["params"], drawn_parameters(found["widths"], seed=0).float())


def test_files_of_opyf_become_a_flow(tmp_path: Path) -> None:
    """Y from the top, zeros are no vectors, and the depths are the free surface."""
    (text,) = BLOCK.findall((GUIDES / "opyf-experiment.md").read_text())
    t, x, y = 0.01 * np.arange(16), np.linspace(0, 1, 12), np.linspace(0.5, 0, 6)
    wider = np.append(x, 1.2)
    depth = 0.35 - 0.02 * wider + t[:, None]
    there = (t > 0.12)[:, None, None] & (y[None, :, None] <= depth[:, None, :12])
    with h5py.File(tmp_path / "Run_02_gridded_velocity.hdf5", "w") as file:
        file["coordinates/T"], file["coordinates/X"], file["coordinates/Y"] = t, x, y
        file["variables/Ux"] = np.where(there, 0.1 + y[:, None] * x, 0)
        file["variables/Uy"] = np.where(there, -0.2 * y[:, None] + 0 * x, 0)
    with h5py.File(tmp_path / "Run_02_depths.hdf5", "w") as file:
        file["coordinates/time"], file["coordinates/x"] = t, wider
        file["variables/depth"] = depth
    (tmp_path / "convert.py").write_text(text)
    with contextlib.chdir(tmp_path), pytest.warns(FlowFileWarning, match="1 of 4 frames hold no"):
        runpy.run_path("convert.py")
    flow = read_flow(tmp_path / "run02.h5")
    np.testing.assert_allclose(flow.t, [0.01, 0.02, 0.03])
    np.testing.assert_array_equal(np.isfinite(flow.u)[:, ::-1], there[13:])
    np.testing.assert_allclose(flow.v[0, 1], -0.02, rtol=1e-6)
    assert flow.surface is not None
    np.testing.assert_allclose(np.sort(flow.surface.y), np.sort(depth[13:, :12].ravel()))


def test_meshes_become_a_flow(tmp_path: Path) -> None:
    """Cells of an unstructured grid, in any order, are a grid again."""
    pyvista = pytest.importorskip("pyvista")
    (text,) = BLOCK.findall((GUIDES / "importing.md").read_text())
    flow = make_flow()
    rng = np.random.default_rng(0)
    for k in range(3):
        shape = (flow.x.size + 1, flow.y.size + 1, 2)
        grid = pyvista.ImageData(dimensions=shape, spacing=(0.1, 0.1, 0.1))
        grid.cell_data["alpha.grains"] = flow.c[k].ravel()
        u, v = (np.nan_to_num(a[k]).ravel() for a in (flow.u, flow.v))
        grid.cell_data["U"] = np.stack([u, v, 0 * u], axis=1)
        grid.extract_cells(rng.permutation(grid.n_cells)).save(tmp_path / f"flow-{k / 10}.vtu")
    (tmp_path / "convert.py").write_text(text)
    with contextlib.chdir(tmp_path):
        runpy.run_path("convert.py")
    found = read_flow(tmp_path / "flow.h5")
    np.testing.assert_allclose(found.t, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(found.x, 0.05 + 0.1 * np.arange(flow.x.size), rtol=1e-6)
    np.testing.assert_array_equal(found.c, flow.c[:3])
    there = flow.valid[:3]
    np.testing.assert_allclose(found.u[there], flow.u[:3][there], rtol=1e-6)
    assert found.surface is not None
