"""The inertial number against its formula, with the pressures that a network can give."""

from __future__ import annotations

import math

import torch

from granpinn.physics.rheology import inertial_number


def test_inertial_number_takes_the_size_of_the_pressure() -> None:
    rate = torch.tensor([0.5, 2.0, 3.0, 4.0], dtype=torch.float64)
    p = torch.tensor([4.0, -4.0, 1e-9, 0.0], dtype=torch.float64)
    got = inertial_number(rate, p, 0.1, 1e-4)
    exact = [0.1 * 0.5 / 2, 0.1 * 2.0 / 2, 0.1 * 3.0 / math.sqrt(1e-4), 0.1 * 4.0 / 1e-2]
    torch.testing.assert_close(got, torch.tensor(exact, dtype=torch.float64))
