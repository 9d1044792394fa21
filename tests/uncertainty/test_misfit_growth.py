"""How errors grow with the misfit of the velocity."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.results.records import Members
from granpinn.uncertainty import calibration, error_bars, held
from granpinn.uncertainty.misfit_growth import MisfitGrowth
from tests.examples import residuals_with

GROWTH = MisfitGrowth(0.5, 9.0, 0.3, 20, "a test")

MEMBERS = Members((0,), {"mu_s": (0.4,), "mu_2": (0.64,)}, (False,))


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
        MisfitGrowth(power, largest, 0.3, 1, "a test")


@pytest.mark.parametrize("implied", [0.0, 1.0, 1.2])
def test_films_whose_misfit_is_not_noise_are_refused(implied: float) -> None:
    with pytest.raises(ValueError, match="implied must be above 0 and below 1"):
        MisfitGrowth(0.5, 2.0, implied, 1, "a test")


@pytest.mark.parametrize(
    ("ratio", "implied", "factor"),
    [(1, 1.0, 1), (4, 0.2, 1), (4, 0.3, 1), (4, 1.0, 2), (4, 0.65, 2**0.5), (18, 1.0, 3)],
)
def test_missed_structure_raises_errors_to_the_proportion(
    ratio: float, implied: float, factor: float
) -> None:
    """Times the growth of films, in proportion where the residuals imply all of the misfit."""
    assert GROWTH.of_structure(ratio, implied) == pytest.approx(factor)


def test_missed_structure_counts_more_than_noise_at_the_lower_end() -> None:
    """The same misfit, once as noise with small residuals, once with those that it implies."""
    table = dataclasses.replace(calibration.load(), growth=GROWTH, scatter=((0.0, 0.0),) * 2)
    assert table.reach is not None
    misfit, at = 4 * table.misfit, held.Held(table.reach.x)
    usual = {name: 10**r.intercept * misfit**r.slope for name, r in table.residuals.items()}
    of_noise = {name: 0.2 * value for name, value in usual.items()}
    sizes = []
    for residuals in (residuals_with(misfit, **of_noise), residuals_with(misfit, **usual)):
        (D, _), *none = error_bars.further(MEMBERS, residuals, table.steps, table, at)
        assert not none
        T = held.relative(at.x, (0.4, 0.64))
        sizes.append(np.sqrt(np.diag(T @ D @ T.T)))
        shown = error_bars.resolution(residuals, table) / table.misfit
        sizes[-1] /= GROWTH.factor(shown)
    np.testing.assert_allclose(sizes[1] / sizes[0], (2, 1), rtol=1e-6)
