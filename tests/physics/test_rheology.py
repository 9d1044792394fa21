"""The inertial number against its formula, with the pressures that a network can give; and the
derivatives of the laws by their parameters against finite differences.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from granpinn.physics.constants import Physics
from granpinn.physics.laws import LAWS, FrictionLaw

STEP = 1e-6  # relative


def test_inertial_number_takes_the_size_of_the_pressure() -> None:
    rate = torch.tensor([0.5, 2.0, 3.0, 4.0], dtype=torch.float64)
    p = torch.tensor([4.0, -4.0, 1e-9, 0.0], dtype=torch.float64)
    got = Physics(0.1, 0, -1, 0, 1e4, 1, 1, 1e-4).inertial_number(rate, p)
    exact = [0.1 * 0.5 / 2, 0.1 * 2.0 / 2, 0.1 * 3.0 / math.sqrt(1e-4), 0.1 * 4.0 / 1e-2]
    torch.testing.assert_close(got, torch.tensor(exact, dtype=torch.float64))


@pytest.mark.parametrize("law", LAWS.values(), ids=lambda law: law.name)
def test_derivatives_by_parameters_are_those_of_differences(law: FrictionLaw) -> None:
    I, theta = np.geomspace(1e-3, 1, 7), np.array([p.typical for p in law.parameters])
    found = law.by_parameters(I, theta)
    assert found.shape == (7, len(theta))
    for k, value in enumerate(theta):
        step = STEP * abs(value)
        above, below = (
            law.friction(I, *np.where(np.arange(len(theta)) == k, theta + s, theta))
            for s in (step, -step)
        )
        np.testing.assert_allclose(found[:, k], (above - below) / (2 * step), rtol=1e-5, atol=1e-8)
