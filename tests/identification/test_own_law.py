"""A law of a user from its definition to a result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from torch import Tensor

import granpinn
from granpinn import laws
from granpinn.config import Config, ConfigError
from granpinn.physics.laws import LAWS
from granpinn.results import ResultsFileError, read_results
from tests.flows import make_flow
from tests.run_folder import SETTINGS


def linear(I: Tensor, theta: Sequence[Tensor]) -> Tensor:
    mu_s, b = theta
    return mu_s + b * I


UNKNOWNS = [laws.Parameter("mu_s", 0.3), laws.Parameter("b", 1.0, bounds=(0.01, 20.0))]


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    """Laws of a test are known in it alone."""
    known = dict(LAWS)
    yield
    LAWS.clear()
    LAWS.update(known)


@pytest.mark.parametrize(
    ("mu", "unknowns", "sentence"),
    [
        (lambda i, theta: theta[0] + i**0.5, UNKNOWNS[:1], "finite derivatives by I and theta"),
        (lambda i, theta: theta[0] / i, UNKNOWNS[:1], "must be positive and finite, got"),
        (lambda i, theta: theta[0] - i, UNKNOWNS[:1], "must be positive and finite, got"),
        (lambda i, theta: 0.4, UNKNOWNS[:1], "failed: AttributeError: 'float'"),
        (lambda i, theta: theta[1] + i, UNKNOWNS[:1], "failed: IndexError"),
        (lambda i, theta: (theta[0] + i)[:2], UNKNOWNS[:1], "failed: "),
        (linear, [], "must have 1 to [0-9]+ parameters, got 0"),
        (linear, UNKNOWNS * laws.MOST_PARAMETERS, "write known numbers into mu"),
        (linear, UNKNOWNS[:1] * 2, "must have different names"),
        (linear, [laws.Parameter("mu_s", -0.3), UNKNOWNS[1]], "cannot start at mu_s = -0.3"),
        (linear, [laws.Parameter("a", 0.3, above=True)], "none before it"),
        (linear, [laws.LawParameter("I0", "I_0", "I0", 0.3, fixed=True)], "must be free"),
    ],
)
def test_a_law_that_cannot_be_used_says_why(
    mu: laws.Friction, unknowns: Sequence[laws.LawParameter], sentence: str
) -> None:
    with pytest.raises(laws.LawError, match=sentence):
        laws.Law("own", mu, unknowns)


def test_a_law_is_known_once_it_is_registered() -> None:
    with pytest.raises(ConfigError, match="law must be one of mu_of_i, coulomb, .*got 'linear'"):
        Config(law="linear")
    for law in (laws.Law("linear", linear, UNKNOWNS) for _ in range(2)):  # a notebook runs twice
        laws.register(law)
        assert LAWS["linear"] is law
    assert Config(law="linear").law == "linear"


def test_from_python_to_the_files_of_a_run(tmp_path: Path, figures: Callable[..., None]) -> None:
    figures("friction_law")
    law = laws.Law("linear", linear, UNKNOWNS, title="linear law")
    result = granpinn.identify(make_flow(), Config(**SETTINGS), law=law, run_dir=tmp_path)
    assert list(result.parameters) == ["mu_s", "b"]
    assert result.friction_law is law
    mu_s, b = result.theta
    assert (mu_s, b) != (0.3, 1.0)  # both were trained
    curve = result.law.curve
    assert curve is not None
    np.testing.assert_allclose(curve.mu, mu_s + b * np.array(curve.I))
    assert (curve.low, result.parameters["b"].std, result.covariance) == (None, None, None)
    assert result.law.reason == "there are error bars for mu(I) only"
    again = read_results(tmp_path / "results.json")
    assert (again.law, again.parameters) == (result.law, result.parameters)
    text = result.report().read_text(encoding="utf-8")
    assert "linear law" in text
    assert (tmp_path / "figures" / "friction_law.png").exists()
    del LAWS["linear"]
    with pytest.raises(ResultsFileError, match=r"or a law that granpinn.laws.register was given"):
        read_results(tmp_path / "results.json")


def test_an_ensemble_and_its_assumptions(tmp_path: Path) -> None:
    law = laws.Law("linear", linear, UNKNOWNS)
    flow = make_flow(attributes={"surface_sd": 0.01})
    result = granpinn.identify(flow, Config(**SETTINGS, members=2), law=law)
    assert result.members is not None
    assert len(result.members.values["b"]) == 2
    (surface,) = result.assumptions
    assert surface.derivative is not None
    assert set(surface.derivative) == {"mu_s", "b"}
