"""What the figures are drawn from: a small run, once per session."""

from __future__ import annotations

import pytest

from tests.run_folder import Contents, make_run, read_run


@pytest.fixture(scope="session")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return read_run(make_run(tmp_path_factory.mktemp("runs") / "finished"))
