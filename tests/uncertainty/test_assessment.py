"""The verdict: the conditions for a result that is good, needs care, or is useless."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from granpinn.results import ErrorPercent, Parameter, Parameters
from granpinn.results.records import Verdict
from granpinn.results.slip import Slip
from granpinn.results.summary import summarize
from granpinn.uncertainty.of_result import Assessment, assess, headline
from tests.examples import make_result

SURE = Parameters(
    mu_s=Parameter(0.4, False, 0.005, (0.392, 0.408)),
    mu_2=Parameter(0.6, False, 0.01, (0.584, 0.616)),
    I0=Parameter(0.3, True),
)


def verdict(drift: float | None = 0.001, **changes: Any) -> Assessment:
    result = make_result(**({"parameters": SURE, "stopped": "steps"} | changes))
    pair = None if drift is None else {"mu_s": drift, "mu_2": drift / 2}
    return assess(result, summarize(result)._replace(drift=pair))


def test_narrow_intervals_of_a_finished_training_are_good() -> None:
    found = verdict()
    assert found.grade == "good"
    assert found.headline == "the friction law is identified."
    assert "μₛ lies between 0.392 and 0.408 (90 % interval, ± 2 %)." in found.reasons
    assert "μ₂ lies between 0.584 and 0.616 (90 % interval, ± 2.7 %)." in found.reasons


@pytest.mark.parametrize(
    ("drift", "grade"), [(None, "good"), (0.01, "good"), (0.011, "care"), (0.051, "bad")]
)
def test_parameters_that_still_move(drift: float | None, grade: str) -> None:
    assert verdict(drift).grade == grade


@pytest.mark.parametrize(
    ("misfit", "grade"), [(None, "good"), (5.0, "good"), (5.1, "care"), (51.0, "bad")]
)
def test_a_velocity_that_is_missed(misfit: float | None, grade: str) -> None:
    assert verdict(error_percent=ErrorPercent(velocity=misfit)).grade == grade


def test_no_interval_asks_for_care() -> None:
    found = verdict(parameters=Parameters(SURE | {"mu_2": Parameter(0.6, False)}))
    assert found.grade == "care"
    assert found.reasons[0] == "μ₂ has no interval: its digits are not its accuracy."


NO_BARS = Parameters(
    mu_s=Parameter(0.4, False), mu_2=Parameter(0.6, False), I0=Parameter(0.3, True)
)


def test_a_law_without_any_error_is_not_to_be_used() -> None:
    law = make_result().law
    assert law.curve is not None
    bare = replace(law, curve=replace(law.curve, low=None, high=None), reason="too few steps")
    unknown = Verdict(None, "mu_s and mu_2 are not known yet: so few steps")
    found = verdict(parameters=NO_BARS, law=bare, determined=None, verdict=unknown)
    assert (found.grade, found.headline) == ("bad", "not to be used: the errors are not known yet.")
    assert found.reasons[0] == f"The errors are not known: {unknown.words}."
    diverged = verdict(
        parameters=NO_BARS, law=bare, determined=None, verdict=unknown, stopped="diverged"
    )
    assert diverged.headline == "not to be used."
    # A band of the curve, or an interval at one I, is an error.
    assert verdict(parameters=NO_BARS, law=law, determined=None, verdict=unknown).grade == "care"


def test_the_terminal_has_the_headline_of_the_page(tmp_path: Path) -> None:
    result = make_result(parameters=SURE, stopped="steps")
    assert headline(result, tmp_path / "history.csv") == assess(result, summarize(result)).headline


def test_a_slip_of_the_flow_file_asks_for_care() -> None:
    data = replace(
        make_result().data, slips=(Slip("improbable", "gravity is 98 m/s^2, and 9.81 on Earth"),)
    )
    found = verdict(data=data)
    assert found.grade == "care"
    assert found.reasons[0] == "The data are improbable: gravity is 98 m/s^2, and 9.81 on Earth."


def test_a_wide_interval_asks_for_care() -> None:
    wide = Parameter(0.6, False, 0.1, (0.44, 0.76))
    found = verdict(parameters=Parameters(SURE | {"mu_2": wide}))
    assert found.grade == "care"
    assert found.reasons[0].endswith("± 27 %): a wide one.")
    none = replace(SURE.mu_s, value=0.0)
    assert verdict(parameters=Parameters(SURE | {"mu_s": none})).grade == "care"


def test_mu_2_beyond_the_data_is_an_extrapolation() -> None:
    band = make_result().inertial_number
    assert band is not None
    found = verdict(inertial_number=replace(band, q95=0.1))
    assert found.grade == "care"
    assert "only 0.33 of I₀, so that μ₂ is an extrapolation" in found.reasons[0]


def test_a_training_that_diverged_is_useless() -> None:
    found = verdict(stopped="diverged", failure="the loss was not finite at step 7")
    assert found.grade == "bad"
    assert found.headline == "not to be used."
    assert found.reasons[0] == "The training diverged: the loss was not finite at step 7."


@pytest.mark.parametrize(("follows", "grade"), [(True, "good"), (None, "good"), (False, "bad")])
def test_data_that_contradict_the_law(follows: bool | None, grade: str) -> None:
    found = verdict(verdict=Verdict(follows, "the residual is 9 times the usual"))
    assert found.grade == grade
    words = "The data contradict the friction law: the residual is 9 times the usual."
    assert (words in found.reasons) == (grade == "bad")
