"""Friction laws in the simulator: constant friction against theory and against mu(I)."""

import numpy as np
import pytest

from granpinn._collapse import Parameters
from granpinn.config import ConfigError
from granpinn.physics.laws import LAWS
from granpinn.simulation import Collapse, Engine
from granpinn.simulation.scene import law_settings
from tests.simulation import problems as p

SMALL = {"cells": 64, "threads": 1}


def state_of(collapse: Collapse, steps: int = 60) -> p.Array:
    """All fields of the state after some steps, one after the other."""
    engine = Engine(collapse)
    for _ in range(steps):
        engine.step(0.01)
    return np.concatenate([field.ravel() for field in vars(engine.state()).values()])


def test_constant_friction_is_mu_of_i_with_equal_limits() -> None:
    """With mu_2 = mu_s the sum mu_s + 0 I/(I0 + I) is exact."""
    constant = state_of(Collapse(0.4, law="coulomb", **SMALL))
    np.testing.assert_array_equal(constant, state_of(Collapse(0.4, 0.4, **SMALL)))
    assert np.abs(constant - state_of(Collapse(0.4, 0.64, **SMALL))).max() > 1e-3


def test_the_cohesion_of_a_law_is_that_of_the_scene() -> None:
    own = state_of(Collapse(0.4, 0.64, c=0.3, law="cohesive", **SMALL))
    np.testing.assert_array_equal(own, state_of(Collapse(0.4, 0.64, cohesion=0.3, **SMALL)))
    assert np.abs(own - state_of(Collapse(0.4, 0.64, **SMALL))).max() > 1e-3
    with pytest.raises(ConfigError, match="has the cohesion c: give c in the place of cohesion"):
        Collapse(law="cohesive", cohesion=0.3)


def test_layer_slides_down_an_incline_like_a_block() -> None:
    """du/dt = g (sin - mu cos): under constant friction all shear is in the cell above the floor.

    That cell is 1/32 of the layer, and the tolerance is as large.
    """
    tangent, mu = 0.5, 0.4
    cosine = 1 / np.sqrt(1 + tangent**2)
    s = p.incline(32, tangent, law="coulomb", theta=(mu,))
    solver = p.start(s)
    p.run(solver, 1.0, 0.02)
    before = solver.state()["u"][16].mean()
    p.run(solver, 2.0, 0.02)
    acceleration = solver.state()["u"][16].mean() - before
    assert acceleration == pytest.approx(cosine * (tangent - mu), rel=1 / 32)


def test_law_of_the_solver_has_its_parameters() -> None:
    s = Parameters()
    assert (s.law, s.theta) == ("mu_of_i", [0.0, 0.0, 0.0])
    for law in LAWS.values():
        theta = [parameter.typical for parameter in law.parameters]
        s.law = law.name
        s.theta = theta
        assert (s.law, s.theta) == (law.name, theta)
        with pytest.raises(
            ValueError, match=f"must have {len(theta)} parameters of the law {law.name}"
        ):
            s.theta = [*theta, 0.1]
    with pytest.raises(ValueError, match="sand"):
        s.law = "sand"


def test_settings_of_a_law() -> None:
    for law in LAWS.values():
        theta = tuple(parameter.typical for parameter in law.parameters)
        collapse = Collapse(**law_settings(law, theta), cells=64)
        assert (collapse.law, collapse.theta) == (law.name, theta)
        weight = 10.0  # rho |g| H of the paper's column
        assert Collapse(law=law.name).theta == tuple(law.to_physical(theta, weight))
        assert Collapse(**law_settings(law, theta, 0.2)).cohesion == (0 if law.cohesion else 0.2)
    with pytest.raises(ConfigError, match="the law coulomb has the parameters mu_s, got mu_2"):
        Collapse(0.4, 0.64, law="coulomb")
    with pytest.raises(
        ConfigError,
        match="law must be one of mu_of_i, coulomb, regularised, power, cohesive, free, got",
    ):
        Collapse(law="sand")
