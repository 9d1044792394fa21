"""The rows of the tables: statistics, the numbers of the paper, and the cases."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from granpinn.data import Flow, Truth
from granpinn.results import ErrorPercent, Parameter, Parameters, Result
from granpinn.tables.paper import TABLE_1, TABLE_2, PaperRow
from granpinn.tables.rows import TableCase, TableRow
from tests.examples import make_result
from tests.flows import make_flow


def flow_of(mu_s: float | None, mu_2: float | None) -> Flow:
    return make_flow(truth=Truth(mu_s, mu_2, 0.3))


def result_of(mu_s: float, mu_2: float, seed: int, p: float | None = 1.0) -> Result:
    parameters = Parameters(
        mu_s=Parameter(mu_s, False), mu_2=Parameter(mu_2, False), I0=Parameter(0.3, True)
    )
    errors = ErrorPercent(mu_s=abs(mu_s - 0.4) / 0.004, pressure=p)
    return make_result(parameters=parameters, seed=seed, error_percent=errors)


def test_median_worst_and_scatter() -> None:
    case = TableCase(flow_of(0.4, 0.64), 0.0)
    values = (0.404, 0.398, 0.400)  # +1, -0.5, 0 %
    pressures = (2, 4, 3)
    row = TableRow(case, [result_of(values[k], 0.64, k, pressures[k]) for k in range(3)])
    assert case.name == "(0.40, 0.64)"
    assert row.value("mu_s") == 0.4
    assert row.error("mu_s") == pytest.approx((0.5, 1.0))
    assert row.scatter("mu_s") == pytest.approx(math.sqrt((1 + 0.25 - 0.25 / 3) / 2))
    assert row.error("pressure") == (3, 4)
    assert row.error("pressure_simulated") == (None, None)
    assert row.failed == 0
    assert row.paper(1) == TABLE_1[0.4, 0.64]
    assert row.paper(2) is None


def test_a_training_that_diverged_is_counted_and_left_out() -> None:
    good, bad = result_of(0.4, 0.6, 0), replace(result_of(9.0, 99.0, 1), failure="not finite")
    row = TableRow(TableCase(flow_of(0.4, 0.64), 0.0), [good, bad])
    assert (len(row.ended), row.failed, row.value("mu_2")) == (1, 1, 0.6)
    assert row.scatter("mu_s") is None
    row = TableRow(TableCase(flow_of(0.4, 0.64), 0.0), [bad])
    assert row.value("mu_s") is None
    assert row.error("mu_s") == (None, None)


def test_a_case_without_true_values_has_the_name_of_its_file() -> None:
    assert TableCase(flow_of(0.4, None), 0.0).name == "in memory"


@pytest.mark.parametrize("row", [*TABLE_1.items(), *(((0.6, 0.84), r) for r in TABLE_2.values())])
def test_the_typed_errors_fit_the_typed_values(
    row: tuple[tuple[float, float], PaperRow],
) -> None:
    """To one unit of the last digit of the values; the errors come from more digits."""
    (mu_s, mu_2), found = row
    assert abs(100 * abs(found.mu_s / mu_s - 1) - found.error_mu_s) <= 0.1 / mu_s
    assert abs(100 * abs(found.mu_2 / mu_2 - 1) - found.error_mu_2) <= 0.1 / mu_2
