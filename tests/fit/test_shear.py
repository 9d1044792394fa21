"""The curve of an identified law in its run folder, from the fields of the fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.fit.case import pose
from granpinn.fit.prediction import shear_of, with_law
from granpinn.results.fields import D2_STAGNANT
from tests.flows import make_flow
from tests.run_folder import SETTINGS, Contents, make_run, read_run, with_values


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("runs") / "finished")


@pytest.fixture(scope="module")
def contents(folder: Path) -> Contents:
    return read_run(folder)


def test_a_run_states_its_law_over_the_points_that_shear(contents: Contents) -> None:
    result, values = contents.result, contents.fields.values
    after = contents.fields.time_of_points() > 0
    shear = after & (values["D2"] * contents.fields.time >= D2_STAGNANT)
    law = result.law
    assert law.I_range is not None
    inside = np.mean(
        (values["I"][shear] >= law.I_range[0]) & (values["I"][shear] <= law.I_range[1])
    )
    assert inside == pytest.approx(0.9, abs=2 / shear.sum() + 1e-6)
    assert law.curve is not None
    mu_s, mu_2, I0 = result.theta
    I = np.array(law.curve.I)
    np.testing.assert_allclose(law.curve.mu, mu_s + (mu_2 - mu_s) * I / (I + I0))
    assert law.reason is not None  # so few steps have no error bars


def test_the_points_are_the_stress_of_the_fit(contents: Contents) -> None:
    K = contents.fields.index.size
    I = np.geomspace(0.01, 0.1, K)
    p = np.where(np.arange(K) % 7 == 0, -1.0, 2.0)  # no ratio where p < 0
    fields = with_values(contents.fields, I=I, D2=1e3, p=p, tau_xx=0.3, tau_xy=-0.4)
    case = pose(make_flow(), Config(**SETTINGS))
    points = with_law(contents.result, case, shear_of(fields)).law.points
    assert points is not None
    np.testing.assert_allclose(points.mu, 0.25, rtol=1e-6)
    known = (p > 0) & (fields.time_of_points() > 0)
    assert 0.85 * known.sum() < sum(points.count) < 0.95 * known.sum()
