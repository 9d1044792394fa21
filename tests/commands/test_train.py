"""The command: exit codes, one sentence for bad input, and the files after a failure."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest

from granpinn import results
from granpinn.commands import train
from granpinn.commands.shared import training_run
from granpinn.commands.train import parse
from granpinn.config import Config
from granpinn.data import write_flow
from granpinn.errors import Interrupted
from granpinn.output import OutputError
from granpinn.simulation import demo_path
from granpinn.training import checkpoint
from granpinn.training.guard import NonFiniteError
from tests.commands.late_parts import run
from tests.flows import make_flow


def refused(capsys: pytest.CaptureFixture[str], code: int, *argv: object) -> str:
    """The one sentence on stderr with which the command ends."""
    capsys.readouterr()
    assert train.main([*map(str, argv)]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("granpinn.train: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err


@pytest.mark.usefixtures("no_report")
def test_it_prints_the_result_and_where_the_report_is(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(flow_file, "--out", tmp_path / "run", "--seed", 3) == 0
    out = capsys.readouterr().out
    assert re.search(r"^mu_s +0\.\d{3}", out, re.MULTILINE)
    assert f"report: {tmp_path / 'run' / 'report.html'}" in out
    assert results.read_results(tmp_path / "run" / "results.json").seed == 3


@pytest.mark.usefixtures("no_report")
def test_resume_needs_nothing_but_the_folder(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(flow_file, "--out", tmp_path / "run") == 0
    first = capsys.readouterr().out
    (tmp_path / "run" / "results.json").unlink()
    assert train.main(["--out", str(tmp_path / "run"), "--resume"]) == 0
    assert capsys.readouterr().out == first


def text_file(path: Path) -> None:
    path.write_text("no vectors\n")


def without_surface(path: Path) -> None:
    write_flow(make_flow(surface=None), path)


def without_surface_p(path: Path) -> None:
    write_flow(make_flow(), path)
    with h5py.File(path, "r+") as file:
        del file["surface_p"]


# tests/data has the rules of the format, and hostile files.
BAD_FILES: dict[str, tuple[Callable[[Path], None], list[str], str]] = {
    "missing": (lambda path: None, [], "flow.h5"),
    "text": (text_file, [], "HDF5"),
    "no surface at V1": (without_surface, [], "V1"),
    "no surface_p at V2": (without_surface_p, ["--level", "V2"], "V2"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_bad_flow_file_is_refused_in_one_sentence(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write, flags, expected = BAD_FILES[case]
    path = tmp_path / "flow.h5"
    write(path)
    err = refused(capsys, 2, path, "--out", tmp_path / "run", *flags)
    assert re.search(expected, err)
    assert not (tmp_path / "run").exists()


def test_no_argument_at_all_is_the_demonstration() -> None:
    config, verbose = parse([])
    assert config.flow == str(demo_path())
    assert demo_path().stat().st_size < 3e6
    assert (config.out, config.steps, verbose) == ("granpinn-demo", 6000, False)
    assert parse([config.flow, "--out", "run"])[0].steps == Config().steps


def test_cuda_that_is_not_there_is_refused(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    err = refused(capsys, 2, flow_file, "--out", tmp_path / "run", "--device", "cuda")
    assert "--device cuda needs" in err


@pytest.mark.usefixtures("no_report")
def test_a_checkpoint_that_cannot_be_written_ends_the_run(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OutputError(f"{path} could not be written (No space left on device): make room")

    monkeypatch.setattr(checkpoint, "write_bytes", full)
    assert run(flow_file, "--out", tmp_path / "run") == 1
    err = capsys.readouterr().err.splitlines()[-1]
    assert str(tmp_path / "run" / "checkpoint" / "step-000000000") in err
    assert "No space left on device" in err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (Interrupted(15, "stopped at step 7"), 143),
        (Interrupted(2, "stopped at step 7"), 130),
        (KeyboardInterrupt(), 130),
        (NonFiniteError("the loss became NaN"), 1),
    ],
)
def test_exit_codes(
    error: BaseException, code: int, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    def fail(*args: object, **kwargs: object) -> None:
        raise error

    monkeypatch.setattr(training_run, "identify", fail)
    refused(capsys, code, "flow.h5", "--out", "run")
