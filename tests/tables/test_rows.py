"""The rows of the tables: statistics, the numbers of the paper, and the cases."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from granpinn.data import Flow, Truth
from granpinn.results import ErrorPercent, Parameter, Parameters, Result
from granpinn.tables.paper import TABLE_1, TABLE_2, PaperRow, case_of, row_1, row_2
from granpinn.tables.rows import TableCase, row_of
from granpinn.tables.study import cases_of
from tests.examples import make_result
from tests.flows import make_flow


def flow_of(mu_s: float | None, mu_2: float | None) -> Flow:
    return make_flow(truth=Truth(mu_s, mu_2, 0.3))


def result_of(mu_s: float, mu_2: float, seed: int, p: float | None = 1.0) -> Result:
    parameters = Parameters(
        mu_s=Parameter(mu_s, False), mu_2=Parameter(mu_2, False), I0=Parameter(0.3, True)
    )
    return make_result(parameters=parameters, seed=seed, error_percent=ErrorPercent(pressure=p))


def test_median_worst_scatter_and_rmse() -> None:
    case = TableCase(flow_of(0.4, 0.64), 0.0)
    values = (0.404, 0.398, 0.400)  # +1, -0.5, 0 %
    pressures = (2, 4, 3)
    row = row_of(case, [result_of(values[k], 0.64, k, pressures[k]) for k in range(3)])
    errors = row.errors["mu_s"]
    assert row.values["mu_s"] == 0.4
    assert errors.median == pytest.approx(0.5)
    assert errors.worst == pytest.approx(1.0)
    assert errors.rmse == pytest.approx(math.sqrt(1.25 / 3))
    assert errors.scatter == pytest.approx(math.sqrt((1 + 0.25 - 0.25 / 3) / 2))
    assert errors.signed_median == pytest.approx(0.0, abs=1e-9)
    assert errors.bias == pytest.approx(0.5 / 3)
    assert (row.errors["pressure"].median, row.errors["pressure"].worst) == (3, 4)
    assert (row.members, row.failed) == (3, 0)


def test_a_training_that_diverged_is_counted_and_left_out() -> None:
    good, bad = result_of(0.4, 0.6, 0), replace(result_of(9.0, 99.0, 1), failure="not finite")
    row = row_of(TableCase(flow_of(0.4, 0.64), 0.0), [good, bad])
    assert (row.members, row.failed, row.values["mu_2"]) == (1, 1, 0.6)
    assert row.errors["mu_s"].scatter is None
    row = row_of(TableCase(flow_of(0.4, 0.64), 0.0), [bad])
    assert row.values["mu_s"] is None
    assert row.errors["mu_s"].median is None


def test_without_a_truth_there_are_values_and_no_errors() -> None:
    row = row_of(TableCase(make_flow(truth=None), 0.0), [result_of(0.4, 0.6, 0, None)])
    assert row.values["mu_s"] == 0.4
    assert row.errors["mu_s"].median is None
    assert row.errors["pressure"].median is None
    assert row.paper_1 is None


def test_the_paper_is_found_by_the_parameters() -> None:
    assert row_1(Truth(0.4, 0.64, 0.3), 0.0) == PaperRow(0.403, 0.622, 0.80, 2.87, 1.59)
    assert row_1(Truth(0.4, 0.64, 0.3), 0.2) is None
    assert row_2(Truth(0.6, 0.84, 0.3), 0.8) == PaperRow(0.586, 0.953, 2.34, 13.4, 14.5)
    assert row_2(Truth(0.6, 0.72, 0.3), 0.8) is None
    assert case_of(Truth(0.41, 0.64)) is None
    assert case_of(Truth(None, 0.64)) is None
    assert case_of(None) is None


@pytest.mark.parametrize("row", [*TABLE_1.items(), *(((0.6, 0.84), r) for r in TABLE_2.values())])
def test_the_typed_errors_fit_the_typed_values(
    row: tuple[tuple[float, float], PaperRow],
) -> None:
    """To one unit of the last digit of the values; the errors come from more digits."""
    (mu_s, mu_2), found = row
    assert abs(100 * abs(found.mu_s / mu_s - 1) - found.error_mu_s) <= 0.1 / mu_s
    assert abs(100 * abs(found.mu_2 / mu_2 - 1) - found.error_mu_2) <= 0.1 / mu_2


def test_noise_is_for_the_reference_case_where_it_is_there() -> None:
    clean = [TableCase(flow_of(0.4, 0.64), 0.0), TableCase(flow_of(0.6, 0.84), 0.0)]
    cases = cases_of(clean, (0.0, 0.2, 0.8), "reference")
    assert [(c.flow.truth and c.flow.truth.mu_s, c.noise) for c in cases] == [
        *((0.4, 0.0), (0.6, 0.0), (0.6, 0.2), (0.6, 0.8))
    ]
    assert len(cases_of(clean, (0.0, 0.2, 0.8), "all")) == 6
    assert len(cases_of(clean[:1], (0.0, 0.2), "reference")) == 2
    assert [c.noise for c in cases_of(clean, (0.2,), "reference")] == [0.2]
