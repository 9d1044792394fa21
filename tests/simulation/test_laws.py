"""Friction laws in the simulator: constant friction against theory and against mu(I)."""

import numpy as np
import pytest

from granpinn._collapse import Parameters
from granpinn.physics.laws import LAWS
from tests.simulation import problems as p


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
