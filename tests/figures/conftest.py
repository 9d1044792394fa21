"""What the figures are drawn from: a small run, once per session."""

from __future__ import annotations

from dataclasses import replace

import pytest

from granpinn.data import Truth
from granpinn.results import Parameter, Parameters, Result
from tests.run_folder import Contents, make_run, read_run


@pytest.fixture(scope="session")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return read_run(make_run(tmp_path_factory.mktemp("runs") / "finished"))


@pytest.fixture
def result(contents: Contents) -> Result:
    """A result with round numbers over a known band."""
    parameters = Parameters(
        mu_s=Parameter(0.4, False), mu_2=Parameter(0.6, False), I0=Parameter(0.25, True)
    )
    truth = Truth(mu_s=0.38, mu_2=0.64, I0=0.3)
    return replace(
        contents.result,
        parameters=parameters,
        truth=truth,
        covariance=None,
        error_bars=None,
    )
