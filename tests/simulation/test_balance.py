"""The output obeys the momentum balance that it is identified from."""

import numpy as np

from granpinn.simulation import Collapse
from tests.simulation.momentum import frames, merge, momentum_balance, regression


def test_friction_law_comes_back_by_regression_with_the_true_pressure() -> None:
    """On 256 cells, to about twice the errors of 512 cells (bench.studies.simulator_validation)."""
    collapse = Collapse(mu_s=0.4, mu_2=0.64, cells=256, threads=1)
    times = [1.0, 1.6, 2.2, 2.8, 3.4]
    triples = frames(collapse, times, 0.025)
    balance = merge([momentum_balance(triple, collapse) for triple in triples])
    assert balance.flowing.sum() > 5_000
    mu_s, mu_2 = regression(balance)
    assert abs(mu_s / collapse.mu_s - 1) < 0.006
    assert abs(mu_2 / collapse.mu_2 - 1) < 0.02


def test_side_walls_enter_the_balance_as_a_body_force() -> None:
    """Walls a tenth of the height apart; without their force mu_s is far too high."""
    settings = {"mu_s": 0.4, "mu_2": 0.64, "cells": 256, "threads": 1, "t_end": 3.0}
    walls = Collapse(**settings, wall_gap=1.0, wall_friction=0.1)
    triples = frames(walls, [1.6, 2.4], 0.025)
    mu_s, _ = regression(merge([momentum_balance(triple, walls) for triple in triples]))
    assert abs(mu_s / 0.4 - 1) < 0.02
    smooth = Collapse(**settings)
    mu_s, _ = regression(merge([momentum_balance(triple, smooth) for triple in triples]))
    assert mu_s > 1.1 * 0.4


def test_shear_bands_obey_the_balance() -> None:
    """mu_s = 0.6, where mu(I) is ill-posed: as small a residual as the reference solver's (0.04,
    on 512 cells)."""
    collapse = Collapse(mu_s=0.6, mu_2=0.84, cells=256, threads=1)
    balances = [momentum_balance(f, collapse) for f in frames(collapse, [1.5, 2.5, 3.5], 0.025)]
    assert np.median(merge(balances).residual) < 0.04
