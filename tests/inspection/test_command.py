"""The command: its output, its files and its errors."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from granpinn.commands.inspect import main
from granpinn.data import Flow, add_noise, write_flow
from granpinn.simulation import demo_path


def test_what_it_prints_and_writes(
    demo: Flow, seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "flow.h5", tmp_path / "inspection"
    write_flow(add_noise(demo, 0.02, seed), path)
    assert main([str(path), "--out", str(out)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) <= 30
    assert max(map(len, printed[:-2])) <= 120
    assert printed[0].startswith("frames ")
    assert f"next: granpinn train {path} --out run" in printed
    content = json.loads((out / "inspect.json").read_text())
    numbers = content["checks"]
    assert content["facts"]
    assert numbers["vectors"]["count"] == int(demo.valid.sum())
    assert numbers["noise"]["relative"] == pytest.approx(0.02, rel=0.25)
    assert numbers["precision"]["expected"]["mu_s"] > 0
    assert numbers["momentum_balance"]["mean"]["mu"] == pytest.approx(0.44, abs=0.03)
    assert "The momentum balance alone, without a network, gives mu = 0." in " ".join(printed)
    for name in ("validity", "speed", "inertial_number"):
        pixels = np.asarray(Image.open(out / f"{name}.png"))
        assert len(np.unique(pixels.reshape(-1, pixels.shape[-1]), axis=0)) > 50


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["missing.h5"], "missing.h5: there is no such file"),
        ([], "the following arguments are required"),
        (["a.h5", "--mu-s", "0.7"], "mu_2 must be at least mu_s = 0.7, got 0.64"),
        (["a.h5", "--I0", "many"], "--I0 must be a number"),
        (["a.h5", "--mu-s", "0"], "mu_s must be larger than 0, got 0"),
        (["a.h5", "--law", "coulomb", "--I0", "0.3"], "the law coulomb has the parameters mu_s"),
        ([str(demo_path()), str(demo_path()), "--json"], "one at a time"),
        ([str(demo_path()), "--out", str(demo_path())], "must be a new or existing folder"),
    ],
)
def test_bad_input(argv: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(argv) == (1 if "existing folder" in message else 2)  # 1: it cannot be written
    assert message in capsys.readouterr().err
