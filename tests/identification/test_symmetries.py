"""Steady flows and chutes through the whole chain: nothing depends on t, or on x."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from granpinn import results
from granpinn.commands.train import main
from granpinn.data import Flow, add_noise, write_flow
from granpinn.fit.case import pose
from granpinn.identification.identify import identify
from granpinn.results import read_fields
from granpinn.results.fields import after_start
from granpinn.training.checkpoint import CheckpointError
from tests.flows import make_chute, make_flow
from tests.runs import Heard, tiny

BOTH = ("the same along x: no derivative along x", "steady: no time derivative")


@pytest.mark.filterwarnings("ignore:.*stated as steady")
@pytest.mark.parametrize("units", ["flow", "file"])
def test_the_network_gets_no_input_that_has_no_effect(units: str) -> None:
    def scale(flow: Flow) -> tuple[float, ...]:
        return pose(flow, tiny(units=units)).member.problem.spec.input_scale

    for frames in (1, 3):
        assert [factor == 0 for factor in scale(make_chute(frames=frames))] == [True, False, True]
    stated_by_nobody = make_chute(frames=3, attributes={})
    assert [factor == 0 for factor in scale(stated_by_nobody)] == [True, False, False]
    only_steady = make_flow(attributes={"steady": 1})
    assert [factor == 0 for factor in scale(only_steady)] == [False, False, True]
    assert all(scale(make_flow()))


def test_every_column_of_a_chute_is_the_same(tmp_path: Path) -> None:
    flow, listener = make_chute(frames=2), Heard()
    result = identify(flow, tiny(), run_dir=tmp_path / "run", progress=listener)
    assert result.data.symmetries == BOTH
    assert "; ".join(BOTH) in listener.said
    assert results.read_results(tmp_path / "run" / "results.json").data.symmetries == BOTH
    fields = read_fields(tmp_path / "run" / "fields.h5")
    assert fields.steady
    assert after_start(fields).all()
    assert fields.t.size == 1
    for name in ("u", "v", "p", "tau_xy", "momentum_residual_x"):
        found = fields.frame(name, 0)
        np.testing.assert_array_equal(found, np.broadcast_to(found[:, :1], found.shape))
    assert np.nanmax(np.abs(fields.frame("v", 0))) == 0
    assert np.nanmax(np.abs(fields.frame("divergence", 0))) == 0
    assert result.error_percent.pressure is not None


def test_a_film_of_a_steady_flow_trains_on_its_mean(tmp_path: Path, seed: int) -> None:
    """Found or stated; a run of one cannot go on as the other."""
    film = add_noise(make_chute(frames=20, attributes={"period_x": 32.0}), 0.05, seed)
    listener = Heard()
    found = identify(film, tiny(), run_dir=tmp_path / "run", progress=listener)
    assert found.data.sampled in listener.said
    assert "the mean over its 20 frames is used" in str(found.data.sampled)
    assert (found.data.symmetries, found.data.n_frames) == (BOTH, 1)
    more = tiny(resume=True)
    moving = dataclasses.replace(film, attributes=film.attributes | {"steady": 0})
    with pytest.raises(CheckpointError, match="another flow file|input scale"):
        identify(moving, more, run_dir=tmp_path / "run")
    stated = dataclasses.replace(film, attributes=film.attributes | {"steady": 1})
    same = identify(stated, tiny())
    assert {n: p.value for n, p in same.parameters.items()} == {
        n: p.value for n, p in found.parameters.items()
    }


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_the_command_on_one_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], figures: Callable[..., None]
) -> None:
    """Training, second opinion, figures and page of a file with a single frame."""
    names = ("velocity", "pressure", "friction_law")
    figures(*names)
    write_flow(make_chute(), tmp_path / "chute.h5")
    few = ("--steps", "60", "--log-every", "20", "--network.widths", "8,8", "--verbose")
    assert main([str(tmp_path / "chute.h5"), "--out", str(tmp_path / "run"), *few]) == 0
    printed = capsys.readouterr()
    assert "warning" not in printed.err
    found = results.read_results(tmp_path / "run" / "results.json")
    assert found.not_done == {}
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "of 1 frame and" in page
    assert "The flow was taken as the same along x" in page
    assert "Arrow keys" not in page
    for name in names:
        assert (tmp_path / "run" / "figures" / f"{name}.png").exists()
