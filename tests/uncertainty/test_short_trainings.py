"""Error bars of trainings with fewer steps than the usual study."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.results import Residuals
from granpinn.uncertainty import calibration, error_bars
from granpinn.uncertainty.calibration import ShortTraining

USUAL = ((4e-5, -1e-4), (-1e-4, 4e-4))
TABLE = dataclasses.replace(
    calibration.load(), steps=1000, mu_s=(0.4,), discrepancy=(USUAL,), shorter=()
)
CLEAN = Residuals(
    velocity=1e-4,
    noise=0.0,
    surface=1e-5,
    momentum=1e-6,
    continuity=1e-6,
    constitutive=1e-6,
)


def test_discrepancy_of_short_trainings_is_that_of_their_study() -> None:
    other = ((9e-5, 0.0), (0.0, 9e-4))
    table = dataclasses.replace(TABLE, shorter=(ShortTraining(250, (other,), 48, "here"),))
    middle = (np.array(USUAL) + np.array(other)) / 2
    for steps, expected in ((250, other), (500, middle), (1000, USUAL), (9000, USUAL)):
        found = error_bars.discrepancy(0.4, CLEAN, steps, table)
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    shorter = error_bars.discrepancy(0.4, CLEAN, 125, table)
    np.testing.assert_allclose(shorter, 2**3 * np.array(other), rtol=1e-12)


@pytest.mark.parametrize("steps", [0, 1000, 2000])
def test_studies_of_other_lengths_are_refused_out_of_order(steps: int) -> None:
    short = ShortTraining(steps, (USUAL,), 48, "here")
    with pytest.raises(ValueError, match="must ascend"):
        dataclasses.replace(TABLE, shorter=(short,))
