"""The inspection of a steady flow: noise in space, no time derivative."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granpinn.commands.inspect import main
from granpinn.data import add_noise, write_flow
from granpinn.data.noise import max_speed
from granpinn.inspection import inspect
from tests.flows import make_chute


@pytest.mark.parametrize("frames", [1, 2, 6])
def test_noise_and_slopes_of_a_steady_flow(frames: int, seed: int) -> None:
    flow = make_chute(frames=frames, rows=40, columns=48)
    sd = 0.02
    found = inspect(add_noise(flow, sd, seed))
    assert found["noise"].sigma == pytest.approx(sd * max_speed(flow) / np.sqrt(frames), rel=0.25)
    assert (found.facts.slopes.du[:, 0] == 0).all()
    assert (found.facts.slopes.sd[:, 0] == 0).all()
    assert found["inertial_number"].q50 == pytest.approx(0.1, rel=0.2)


def test_a_film_of_a_steady_flow_is_inspected_as_its_mean(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    """What was found is one line; `steady = 0` in the file keeps the frames."""
    film = add_noise(make_chute(frames=20, rows=40, columns=48, attributes={}), 0.05, seed)
    film = replace(film, sigma_u=None, sigma_v=None)
    write_flow(film, tmp_path / "film.h5")
    assert main([str(tmp_path / "film.h5")]) == 0
    printed = capsys.readouterr().out
    assert printed.count("the mean over its 20 frames is used") == 1
    assert "the mean has a standard error of 0.0" in printed
    assert "contradict" not in printed
    write_flow(replace(film, attributes={"steady": 0}), tmp_path / "film.h5")
    assert main([str(tmp_path / "film.h5")]) == 0
    assert "mean over its" not in capsys.readouterr().out
