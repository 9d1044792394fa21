"""How errors grow with the misfit of the velocity."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.uncertainty import calibration, error_bars
from granpinn.uncertainty.calibration import MisfitGrowth
from tests.examples import residuals_with

GROWTH = MisfitGrowth(0.5, 9.0, 20, "a test")


@pytest.mark.parametrize(("ratio", "factor"), [(1, 1), (4, 2), (9, 3), (18, 6)])
def test_errors_grow_as_measured(ratio: float, factor: float) -> None:
    """With the root up to 9 times the misfit of the table, and in proportion from there."""
    assert GROWTH.factor(ratio) == pytest.approx(factor)
    shipped = calibration.load()
    table = dataclasses.replace(shipped, growth=GROWTH)
    clean = residuals_with(ratio * table.misfit)
    limits = {n: dataclasses.replace(r, limit=1e9) for n, r in table.residuals.items()}
    table = dataclasses.replace(table, residuals=limits)
    D = error_bars.discrepancy(0.4, clean, table.steps, table)
    np.testing.assert_allclose(D, factor**2 * table.discrepancy_at(0.4, table.steps), rtol=1e-9)


def test_the_shipped_table_has_a_growth_that_films_gave() -> None:
    growth = calibration.load().growth
    assert growth is not None
    assert growth.flows >= 20
    assert 0 < growth.power < 1


@pytest.mark.parametrize(("power", "largest"), [(-0.1, 2.0), (1.1, 2.0), (0.5, 0.9)])
def test_a_growth_out_of_range_is_refused(power: float, largest: float) -> None:
    with pytest.raises(ValueError, match="power must be 0 to 1"):
        MisfitGrowth(power, largest, 1, "a test")
