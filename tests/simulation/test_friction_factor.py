"""A factor on the friction that differs from place to place and in time."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.simulation import Collapse
from granpinn.simulation.engine import Engine, State

SETTINGS = {"aspect": 2.0, "cells": 32, "stride": 1, "threads": 1, "d": 0.2, "t_end": 4.0}


def ran(scene: Collapse, factor: Float64 | None) -> State:
    engine = Engine(scene)
    if factor is not None:
        engine.set_friction_factor(factor)
    while engine.time < 3.0 - 1e-9:
        engine.step(3.0 - engine.time)
    return engine.state()


def everywhere(scene: Collapse, value: float) -> Float64:
    s = scene.resolved()
    return np.full((s.cells_y, s.cells_x), value)


def test_factor_1_changes_nothing() -> None:
    scene = Collapse(0.4, 0.64, **SETTINGS)
    plain, one = ran(scene, None), ran(scene, everywhere(scene, 1.0))
    for name in ("c", "u", "v", "p"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(one, name))


def test_factor_scales_the_law() -> None:
    """mu(I) is linear in (mu_s, mu_2). The factor rounds once more, and the solves of a step end at
    a tolerance of 1e-4: steps of both runs differ by less."""
    weak, strong = Collapse(0.3, 0.5, **SETTINGS), Collapse(0.45, 0.75, **SETTINGS)
    scaled, known = ran(weak, everywhere(weak, 1.5)), ran(strong, None)
    speed = float(np.sqrt(np.mean(known.u**2)))
    assert float(np.sqrt(np.mean((scaled.u - known.u) ** 2))) < 1e-3 * speed
    other = ran(weak, None)
    assert float(np.sqrt(np.mean((other.u - known.u) ** 2))) > 0.05 * speed
