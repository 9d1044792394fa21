"""The commands of docs/guides/opyf-experiment.md, with a simulated run in the layout of opyf."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path

import h5py
import numpy as np
import pytest

from granpinn import simulate
from granpinn.commands.convert import main
from granpinn.data import read_flow
from granpinn.data.surface import line_heights
from granpinn.inspection import quick
from granpinn.simulation.parameters import Collapse

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "opyf-experiment.md"
RELEASE = 12  # the last frame at rest
SLOPE = math.radians(15)


def scene() -> Collapse:
    """Gravel of 3 mm on a slope, in SI."""
    return Collapse(
        mu_s=0.6,
        mu_2=0.8,
        d=3e-3,
        height=0.2,
        aspect=1.0,
        gravity=(9.81 * math.sin(SLOPE), -9.81 * math.cos(SLOPE)),
        box_width=0.96,
        box_height=0.24,
        density=1500.0,
        wall_gap=0.06,
        cells=192,
        stride=2,
        frames=11,
        t_end=0.1,
        length_unit="m",
        time_unit="s",
    )


@pytest.fixture(scope="module")
def words(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The arguments of the first command of the guide, whose files exist."""
    flow, folder = simulate(scene()), tmp_path_factory.mktemp("opyf")
    text = GUIDE.read_text().replace("RHO", "2500").replace("PHI", "0.6").replace('"D mm', '"3 mm')
    command = re.search(r"^granpinn convert (.*?)\ngranpinn", text, re.MULTILINE | re.DOTALL)
    assert command is not None
    names = shlex.split(command[1].replace("\\\n", " "))
    words = [str(folder / name) if name.endswith("5") else name for name in names]
    before = np.arange(-RELEASE, 1) * flow.t[0]  # the first frame of a simulation is one step later
    t, inside = np.concatenate([before, flow.t]) + 3.0, flow.material
    assert flow.surface is not None
    line = flow.surface
    with h5py.File(words[0], "w") as file:
        file["coordinates/T"], file["coordinates/X"] = t, flow.x
        file["coordinates/Y"] = flow.y[::-1]
        for name, values in (("Ux", flow.u), ("Uy", flow.v)):
            moving = np.where(inside, values, 0)[:, ::-1]
            still = np.zeros((RELEASE + 1, *moving.shape[1:]))
            file[f"variables/{name}"] = np.concatenate([still, moving])
    wide = np.linspace(-0.5, 1.5, 400)  # the whole picture
    height = np.nan_to_num(line_heights(flow.t, wide, line))
    height[:, wide < -0.4] = 0.2  # something else in the picture
    with h5py.File(words[words.index("--surface") + 1], "w") as file:
        file["coordinates/time"], file["coordinates/x"] = t, wide
        file["variables/depth"] = np.concatenate([np.repeat(height[:1], RELEASE + 1, 0), height])
    return words


def test_the_commands_of_the_guide_make_the_flow(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 0
    said = capsys.readouterr()
    assert said.err.count("lie beyond the sides of the vectors") == 1
    assert "side walls" in said.out
    made, true = read_flow(words[words.index("--out") + 1]), simulate(scene())
    np.testing.assert_allclose(made.t, true.t, atol=1e-9)
    np.testing.assert_allclose(made.gravity, true.gravity)
    assert made.attributes["wall_gap"] == pytest.approx(0.06)
    assert made.density == pytest.approx(1500)
    both = np.isfinite(made.u) & true.material
    assert both.sum() > 0.9 * true.material[true.t > 0].sum()
    np.testing.assert_allclose(made.u[both], true.u[both], rtol=1e-5, atol=1e-6)
    assert made.surface is not None
    assert made.surface.x.min() >= made.x[0]
    assert made.surface.x.max() <= made.x[-1]
    assert quick(made).slips == ()
