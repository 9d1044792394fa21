"""mu_s and the slope of mu(I) where I0 is not known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from granpinn import results
from granpinn.checks.unknown_I0 import REACH, VALUES, mixture, unknown_I0
from granpinn.commands import train
from granpinn.config import Config, ConfigError
from granpinn.errors import CannotGoOn
from granpinn.results import Covariance, Parameter, Parameters, Result
from granpinn.results.records import ErrorBars, IdentifiedLaw
from granpinn.results.result import NORMAL_90
from granpinn.uncertainty.error_model import ends_of, line
from tests.examples import make_result

I_RANGE = (0.01, 0.2)


ENDS = np.array([0.42, 0.5])  # mu at the ends of the range, which all laws share


SD = np.array([0.004, 0.006])  # of these, independent


def law(I0: float) -> tuple[float, float]:
    mu_s, mu_2 = np.linalg.solve(line(ends_of(I_RANGE, I0)), ENDS)
    return float(mu_s), float(mu_2)


def run(I0: float = 0.3) -> Result:
    """A run whose covariance is that of independent errors of mu at the ends."""
    mu_s, mu_2 = law(I0)
    back = np.linalg.inv(line(ends_of(I_RANGE, I0)))
    C = back @ np.diag(SD**2) @ back.T
    return make_result(
        parameters=Parameters(
            mu_s=Parameter(mu_s, False), mu_2=Parameter(mu_2, False), I0=Parameter(I0, True)
        ),
        covariance=Covariance(("mu_s", "mu_2"), tuple(map(tuple, C.tolist()))),
        law=IdentifiedLaw(I_range=I_RANGE),
        error_bars=ErrorBars((0.0, 0.0), 50.0, NORMAL_90, "made up"),
    )


def test_the_intervals_hold_90_percent_of_all_laws_through_both_ends() -> None:
    found = unknown_I0(run())
    assert pytest.approx((0.3 / REACH, 0.3 * REACH)) == found.I0
    draws = []
    generator = np.random.default_rng(0)
    for I0 in np.geomspace(*found.I0, VALUES):
        mu = ENDS + SD * generator.normal(size=(8_000, 2))
        mu_s, mu_2 = np.linalg.solve(line(ends_of(I_RANGE, I0)), mu.T)
        draws.append(np.stack([mu_s, (mu_2 - mu_s) / I0]))
    for name, values in zip(("mu_s", "slope"), np.concatenate(draws, axis=1), strict=True):
        low, high = found.parameters[name].interval_90 or (0, 0)
        assert np.mean(values < low) == pytest.approx(0.05, abs=0.005)
        assert np.mean(values > high) == pytest.approx(0.05, abs=0.005)
        assert found.parameters[name].std == pytest.approx(values.std(), rel=0.02)
    assert "slope 0." in str(found)


def test_the_law_of_another_I0_has_the_same_ends() -> None:
    """A run with another I0 says the same of the I0 that both allow."""
    one, other = (unknown_I0(run(I0)).parameters for I0 in (0.3, 0.33))
    for name in ("mu_s", "slope"):
        assert one[name].value == pytest.approx(other[name].value, rel=0.05)


def test_one_law_has_its_own_error() -> None:
    found = mixture(np.array([2.0]), np.array([0.1]), np.ones(1))
    assert found.value == pytest.approx(2.0)
    assert found.interval_90 == pytest.approx((2 - 0.1645, 2 + 0.1645), abs=1e-3)
    assert found.std == pytest.approx(0.1)
    wide = mixture(np.log([2.0, 3.0]), np.array([0.01, 0.01]), np.full(2, 0.5), logarithmic=True)
    assert wide.interval_90 is not None
    assert wide.interval_90[0] == pytest.approx(2.0, rel=0.03)
    assert wide.interval_90[1] == pytest.approx(3.0, rel=0.03)


def test_a_run_without_error_bars_has_none() -> None:
    with pytest.raises(CannotGoOn, match="the run has no error bars"):
        unknown_I0(make_result(covariance=None))
    with pytest.raises(ConfigError, match="free_I0 is for .*, got law coulomb"):
        Config(free_I0=True, law="coulomb")


@pytest.mark.usefixtures("no_report")
def test_the_command_says_why_there_is_none(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--steps", "6", "--network.widths", "6,5", "--batch.interior", "16"]
    flags += ["--checks", "none", "--free-I0"]
    assert train.main([str(flow_file), "--out", str(tmp_path / "run"), *flags]) == 1
    assert "no unknown I0: the run has no error bars" in capsys.readouterr().err
    found = results.read_results(tmp_path / "run" / "results.json")
    assert list(found.not_done) == ["unknown_I0"]
    assert math.isfinite(found.parameters.mu_s.value)
