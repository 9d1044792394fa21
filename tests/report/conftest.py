"""One run folder per session; tests that change it get a copy."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from granpinn import load
from tests.run_folder import Contents, make_run, read_run


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder without figures and page; not to be changed."""
    return make_run(tmp_path_factory.mktemp("runs") / "finished")


@pytest.fixture(scope="session")
def contents(finished: Path) -> Contents:
    return read_run(finished)


@pytest.fixture(scope="session")
def built(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with all figures and the page; not to be changed."""
    folder = tmp_path_factory.mktemp("runs") / "built"
    shutil.copytree(finished, folder)
    load(folder).report()
    return folder


@pytest.fixture
def run_dir(finished: Path, tmp_path: Path) -> Path:
    """A run folder of one's own, without figures and page."""
    return Path(shutil.copytree(finished, tmp_path / "run"))
