"""A result of another friction law than mu(I): its names, file, page, figures and judgement."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas
import pytest

from granpinn.config import Config
from granpinn.data import Truth
from granpinn.figures import page as pages
from granpinn.physics.laws import LAWS
from granpinn.results import (
    Covariance,
    ErrorPercent,
    IdentifiedLaw,
    Parameter,
    Parameters,
    Result,
    read_results,
    write_results,
)
from granpinn.results.records import Members
from granpinn.results.result import friction_sd, true_friction
from granpinn.uncertainty.error_bars import center, judge, most_central
from tests.examples import make_result
from tests.page import Page

LAW = LAWS["coulomb"]


MEMBERS = Members((0, 1, 2), {"mu_s": (0.30, 0.33, 0.36)})


def coulomb(**changes: object) -> Result:
    usual = {
        "law": IdentifiedLaw(LAW.name),
        "parameters": Parameters(mu_s=Parameter(0.33, fixed=False)),
        "truth": Truth(0.3, law=LAW.name),
        "error_percent": ErrorPercent(mu_s=10.0, velocity=1.0),
        "covariance": None,
        "error_bars": None,
        "members": MEMBERS,
    }
    return make_result(**(usual | changes))


def test_results_json_has_the_names_of_the_law(tmp_path: Path) -> None:
    write_results(coulomb(), tmp_path / "results.json")
    content = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert content["law"]["name"] == "coulomb"
    assert list(content["parameters"]) == ["mu_s"]
    assert content["members"]["values"]["mu_s"] == [0.30, 0.33, 0.36]
    assert "mu_2" not in content["error_percent"]
    assert read_results(tmp_path / "results.json") == coulomb()


@pytest.mark.parametrize("law", [None, {"name": "mu_of_i"}], ids=["no law", "a law without curve"])
def test_a_file_of_an_earlier_version_is_read(law: object, tmp_path: Path) -> None:
    content = make_result().to_dict()
    content["law"] = law
    if law is None:
        del content["law"]
    (tmp_path / "results.json").write_text(json.dumps(content))
    assert read_results(tmp_path / "results.json") == make_result(law=IdentifiedLaw("mu_of_i"))


def test_table_row_and_page_have_its_parameters_alone(tmp_path: Path) -> None:
    result = coulomb()
    row_of_mu_s = result.summary().splitlines()[1].split()
    assert row_of_mu_s == ["mu_s", "0.3300", "-", "-", "0.3000", "10.00"]
    assert "I0" not in result.summary()
    row = pandas.json_normalize(result.to_dict()).loc[0]
    assert (row["law.name"], row["parameters.mu_s.value"]) == ("coulomb", 0.33)
    assert row["error_percent.mu_s"] == 10.0
    assert not {"parameters.mu_2.value", "error_percent.mu_2"} & set(row.index)
    page = Page(pages.render(result))
    assert "μs 0.330 true 0.300" in page.text
    assert "friction law “constant friction”" in page.text
    assert "μ2" not in page.text


def test_values_without_error_bars_and_the_reason() -> None:
    config = Config(law="coulomb")
    assert center(MEMBERS, LAW) == pytest.approx((0.33,))
    assert most_central(MEMBERS, LAW) == 1
    found = judge(make_result(members=MEMBERS), None, config)
    assert found == "there are error bars for mu(I) only"


def test_the_true_law_and_the_error_are_those_of_the_law() -> None:
    I = np.array([0.1, 1.0])
    np.testing.assert_allclose(true_friction(coulomb(), I), 0.3)  # type: ignore[arg-type]
    covariance = Covariance(("mu_s",), ((0.01**2,),))
    np.testing.assert_allclose(friction_sd(np.array([0.1, 1.0]), coulomb(), covariance), 0.01)
